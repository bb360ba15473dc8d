"""Reference R and T of a case, with derivatives, to 50 digits, by the characteristic matrix.

H. A. Macleod, Thin-Film Optical Filters, chapter 2. With k₀d·sinc(k₀d q) = sin(k₀d q)/q it is defined
at q = 0. The admittances of p are q/ε (for the magnetic field), so that 90° does not divide by 0.
"""

from __future__ import annotations

from cases import FREE, PARAMETERS, Case
from mpmath import mp, mpc, mpf

STEP = mpf(10) ** -30
"""Step of the central difference, whose error is of order 1e-60."""


def truth(case: Case, slopes: bool = True) -> dict[str, dict[str, list[float]]]:
    """{"values": {signal: [number]}, "slopes": {signal: one per FREE parameter}}, correctly rounded."""
    with mp.workdps(100):
        at = {name: mpf(case[name]) for name in PARAMETERS}
        found = {"values": {s: [float(x)] for s, x in _signals(at).items()}}
        if slopes:
            columns = [_slope(at, name) for name in FREE]
            found["slopes"] = {s: [float(c[s]) for c in columns] for s in columns[0]}
        return found


def _slope(at, name):
    above, below = (_signals(at | {name: at[name] + sign * STEP}) for sign in (1, -1))
    return {signal: (above[signal] - below[signal]) / (2 * STEP) for signal in above}


def _signals(at):
    theta = at["angle"] * mp.pi / 180
    a = at["ambient_n"] * mp.sin(theta)
    eps = [
        at["ambient_n"] ** 2,
        mpc(at["layer_n"], at["layer_k"]) ** 2,
        mpc(at["substrate_n"], at["substrate_k"]) ** 2,
    ]
    q = [at["ambient_n"] * mp.cos(theta), *(_root(e - a * a) for e in eps[1:])]
    depth = 2 * mp.pi * at["thickness"] / at["wavelength"]
    cosine, sine = mp.cos(depth * q[1]), depth * mp.sinc(depth * q[1])
    signals = {}
    for letter in "sp":
        w = [1, 1, 1] if letter == "s" else eps
        top, bottom = q[0] / w[0], q[2] / w[2]
        one = cosine - 1j * sine * w[1] * bottom
        other = bottom * cosine - 1j * sine * q[1] ** 2 / w[1]
        below = abs(top * one + other) ** 2
        signals["R" + letter] = abs(top * one - other) ** 2 / below
        signals["T" + letter] = 4 * top * mp.re(bottom) / below
    return signals


def _root(square):
    q = mp.sqrt(square)
    return -q if mp.im(q) < 0 else q
