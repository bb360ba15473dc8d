"""Adapters, one module per package: `values(case)` and, if the package has gradients, `slopes(case)`.

`values` returns {signal: [number]} for the signals that the package computes, `slopes` {signal: one number
for each of `cases.FREE`}. Each calls its package as the package's documentation describes.
"""
