"""Writes absorption.json: absorptances and fields of hard stacks with their derivatives, to 50 digits.

Absorptances are differences between the net powers through the faces of a layer, at 160 digits, where no
cancellation matters; |E|² at a depth is made of the same characteristic matrices (H. A. Macleod, Thin-Film
Optical Filters, chapter 2). Beside each number stands its condition: by how much it changes, to first order,
where every input changes by its own size. Run as `python tests/hard/make_absorption.py`.
"""

import json
from itertools import pairwise
from pathlib import Path

from make_stacks import STACKS, case, natural
from mpmath import mp, mpc, mpf
from stack_truth import conditions, differences, unpack

LAYERS = 3
SHARES = (0.4, 0.3, 0.7)
"""Depth within each layer at which |E|² is computed, as a share of its thickness."""
OUTSIDE = 40.0
"""Its distance from the stack in the ambient and in the substrate, nm."""

MORE = {
    "0.1 mm of k = 0.01": case((1e5, 1.5 + 1e-2j), (50.0, 2.1), (30.0, 1.38)),
    "metal of kd = 1e4": case((100.0, 1.46), (3e5, 0.5 + 4j), (80.0, 2.1 + 0.1j)),
    "k = 1e-12 under metal": case((30.0, 0.2 + 3.4j), (120.0, 1.9 + 1e-12j), (30.0, 0.2 + 3.4j)),
    "k = 1e-12 beyond total reflection": case(
        (100.0, 1.3 + 1e-12j), (200.0, 1.0), (30.0, 1.38 + 1e-12j), ambient=1.52, angle=70.0, substrate=1.0
    ),
    "absorbing gap of 2 µm": case(
        (50.0, 1.8), (2000.0, 1.0 + 1e-3j), (50.0, 1.8), ambient=1.5, substrate=1.5
    ),
    "thin absorber at a node": case(
        (275.0, 1.0), (1.0, 3.0 + 2j), (1e-3, 1.0), substrate=0.01 + 20j, angle=0.0
    ),
}
CASES = STACKS | MORE


def outputs(p, near=None):
    """A of each layer and |E|² in the ambient, each layer and the substrate, for s and p in turn."""
    depth, eps, q, k0 = unpack(p, near)
    return _of_one("s", p, depth, eps, q, k0) + _of_one("p", p, depth, eps, q, k0)


def _of_one(letter, p, depth, eps, q, k0):
    s, a = letter == "s", p[-3] * mp.sin(p[-2] * mp.pi / 180)
    weights = [mpf(1)] * len(eps) if s else eps
    top, bottom = q[0] / weights[0], q[-1] / weights[-1]

    def above(fields, i, t):
        """Fields (E, H) of s or (H, E) of p at a height t over those of medium i."""
        (U, V), phase = fields, k0 * t * q[i]
        c, f = mp.cos(phase), mp.sin(phase) / q[i]
        return c * U - 1j * f * weights[i] * V, c * V - 1j * f * q[i] ** 2 / weights[i] * U

    faces = [(mpf(1), bottom)]
    for i in range(LAYERS, 0, -1):
        faces.insert(0, above(faces[0], i, depth[i - 1]))
    scale = abs(2 * top / (top * faces[0][0] + faces[0][1])) ** 2
    powers = [scale * mp.re(U * mp.conj(V)) / top for U, V in faces]
    wave = mp.exp(1j * k0 * mpf(OUTSIDE) * q[-1])
    places = [above(faces[0], 0, mpf(OUTSIDE))]
    places += [above(faces[i + 1], i + 1, (1 - mpf(x)) * depth[i]) for i, x in enumerate(SHARES)]
    places += [(wave, bottom * wave)]
    found = [one - other for one, other in pairwise(powers)]
    for (U, V), permittivity in zip(places, eps, strict=True):
        electric = abs(U) ** 2 if s else p[-3] ** 2 * (abs(V) ** 2 + abs(a * U / permittivity) ** 2)
        found.append(scale * electric)
    return found


def rounding(p):
    """What the error of each input is proportional to in a derivative.

    An index is rounded as n + ik, but of an extinction below 1e-6 nothing may be lost.
    """
    sizes = [abs(x) for x in p]
    pairs = [(LAYERS + i, 2 * LAYERS + i) for i in range(LAYERS)] + [(3 * LAYERS, 3 * LAYERS + 1)]
    for n, k in pairs:
        if p[k] > mpf(10) ** -6:
            sizes[n] = sizes[k] = abs(mpc(p[n], p[k]))
    return sizes


def row(given):
    p = [mpf(x) for x in given["at"]]
    value = outputs(p)
    out = {"at": given["at"], "smooth": given["smooth"], "value": [float(x) for x in value]}
    if not given["smooth"]:
        return out
    near = unpack(p, None)[2][-1]
    first = differences(lambda x: outputs(x, near), p)
    out["slope"] = [[float(x) for x in column] for column in first]
    spread = [
        abs(v) + sum(abs(x) * abs(column[i]) for x, column in zip(p, first, strict=True))
        for i, v in enumerate(value)
    ]
    floors = [
        [floor * abs(v) + abs(x) for v, x in zip(value, column, strict=True)]
        for floor, column in zip(natural(p), first, strict=True)
    ]
    out["slope_condition"] = conditions(lambda x: outputs(x, near), p, floors, rounding(p))
    out["condition"] = [float(f"{float(x):.3g}") for x in spread]
    return out


def main():
    found = {name: row(given) for name, given in CASES.items()}
    text = json.dumps({"shares": SHARES, "outside": OUTSIDE, "cases": found}).replace('}, "', '},\n"')
    Path(__file__).with_name("absorption.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
