"""One module for each package: `values(case)` and, where it has gradients, `slopes(case)`.

`values` gives {signal: [number]} for the signals that the package has, `slopes` {signal: one number
for each of `cases.FREE`}. Each calls its package as its documentation says.
"""
