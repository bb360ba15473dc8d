"""Export of a film's appearance to renderers: glTF, MaterialX, OpenPBR, USD and others.

`targets` lists the formats, one module each. `appearance` has the exact colours of a film from 0 to 80
degrees, `formula` what is known of a renderer's own formula, `effective` the numbers with which that formula
comes closest to the exact colours, `material` both sets of numbers with their errors.
"""
