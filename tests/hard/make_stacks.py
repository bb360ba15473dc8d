"""Writes stacks.json: R, T, N, C and S of hard films and stacks with their derivatives, to 50 digits.

The numbers put in are float32's own, so that both precisions share one truth, `stack_truth`. Beside each
number stands its condition: by how much it changes, to first order, where every input changes by its own
size. Run as `python tests/hard/make_stacks.py`; it takes some minutes.
"""

import json
from itertools import chain
from pathlib import Path

import numpy as np
from mpmath import mp, mpc, mpf
from stack_truth import agree, by_matrix, by_recursion, conditions, differences, unpack

SIGNALS = ("Rs", "Rp", "Ts", "Tp", "N", "C", "S")


def case(*layers, substrate=3.9 + 0.02j, ambient=1.0, angle=55.0, wavelength=550.0, smooth=True, dark=False):
    """One row: layers as (thickness, n + ik) from the top down, as thicknesses, n, k and the rest.

    `dark`: nothing is reflected, so that N, C and S have no value.
    """
    depth, index = [d for d, _ in layers], [complex(n) for _, n in layers]
    below = complex(substrate)
    media = [n.real for n in index] + [n.imag for n in index] + [below.real, below.imag]
    at = np.array([*depth, *media, ambient, angle, wavelength], np.float32)
    return {"at": [float(x) for x in at], "smooth": smooth, "dark": dark}


GLASS = {"ambient": 1.5, "angle": 60.0, "substrate": 1.5}
STACKS = {
    "ordinary": case((137.0, 1.46), (40.0, 2.1 + 0.3j), (210.0, 1.38), substrate=1.52),
    "ordinary, normal incidence": case((137.0, 1.46), (40.0, 2.1 + 0.3j), (210.0, 1.38), angle=0.0),
    "opaque in the middle": case((100.0, 1.46), (2000.0, 1.2 + 7j), (80.0, 2.1)),
    "1 mm of k = 3 in the middle": case((100.0, 1.46), (1e6, 2.9 + 3j), (80.0, 2.1)),
    "1 mm transparent in the middle": case((100.0, 2.1), (1e6, 1.46), (80.0, 2.1)),
    "all matched": case((100.0, 1.5), (0.0, 1.5), (30.0, 1.5), substrate=1.5, ambient=1.5, dark=True),
    "matched to the substrate": case((100.0, 2.1), (50.0, 1.52), (30.0, 1.52), substrate=1.52),
    "matched to the ambient": case((100.0, 1.0), (50.0, 1.0), (30.0, 2.1 + 0.3j), substrate=1.52),
    "matched to each other": case((100.0, 2.1 + 0.3j), (50.0, 2.1 + 0.3j), (30.0, 2.1 + 0.3j)),
    "20 nm gap": case((50.0, 1.8), (20.0, 1.0), (50.0, 1.8), **GLASS),
    "200 nm gap": case((50.0, 1.8), (200.0, 1.0), (50.0, 1.8), **GLASS),
    "20 µm gap": case((50.0, 1.8), (2e4, 1.0), (50.0, 1.8), **GLASS),
    "Kretschmann with its adhesion layer": case(
        (2.0, 3.1 + 3.3j),
        (48.0, 0.135 + 4j),
        (10.0, 1.46),
        ambient=1.515,
        angle=45.5,
        wavelength=633.0,
        substrate=1.0,
    ),
    "no thickness at all": case((0.0, 1.46), (0.0, 1.2 + 7j), (0.0, 2.1)),
    "a metal of no thickness": case((100.0, 1.46), (0.0, 1.2 + 7j), (80.0, 2.1)),
    "thickness 1e-6 nm": case((1e-6, 1.46), (1e-6, 1.2 + 7j), (1e-6, 2.1)),
    "k = -0.0": case((100.0, complex(1.46, -0.0)), (50.0, complex(2.1, -0.0)), (30.0, 1.38), substrate=1.52),
    "k = 1e-12": case((100.0, 1.46 + 1e-12j), (50.0, 2.1 + 1e-12j), (30.0, 1.38), substrate=1.52),
    "k = 1e-30": case((100.0, 1.46 + 1e-30j), (50.0, 2.1 + 1e-30j), (30.0, 1.38), substrate=1.52),
    "89.999 degrees": case((100.0, 1.46), (50.0, 2.1 + 0.3j), (30.0, 1.38), angle=89.999),
    "exactly 90 degrees": case((100.0, 1.46), (50.0, 2.1 + 0.3j), (30.0, 1.38), angle=90.0),
    "critical in the middle": case(
        (100.0, 1.46), (300.0, 0.75), (30.0, 1.38), ambient=1.5, angle=30.0, substrate=1.52
    ),
    "critical in the substrate": case(
        (100.0, 1.46), (300.0, 2.1), (30.0, 1.38), ambient=1.5, angle=30.0, substrate=0.75, smooth=False
    ),
    "total reflection in the substrate": case(
        (100.0, 1.46), (300.0, 2.1), (30.0, 1.38), ambient=1.52, substrate=1.0
    ),
    "n = 0.05 + 4i": case((20.0, 0.05 + 4j), (100.0, 1.46), (20.0, 0.05 + 4j)),
    "metal substrate": case((100.0, 1.46), (50.0, 2.1), (30.0, 1.38), substrate=0.2 + 3.4j),
    "dense ambient": case((100.0, 1.33), (50.0, 2.1), (30.0, 1.38), ambient=1.52, substrate=1.7, angle=40.0),
    "wavelength 1e7 nm": case((100.0, 1.46), (50.0, 2.1 + 0.3j), (30.0, 1.38), wavelength=1e7),
    "wavelength 1 nm": case(
        (100.0, 1 - 1e-3 + 1e-4j),
        (50.0, 1 - 2e-3 + 2e-4j),
        (30.0, 1 - 1e-3),
        wavelength=1.0,
        angle=20.0,
        substrate=0.999 + 1e-4j,
    ),
}


def film(thickness=137.0, layer=1.46, **more):
    """A row of one layer."""
    return case((thickness, layer), **more)


FILMS = {
    "ordinary, absorbing film": film(layer=2.1 + 0.3j),
    "ordinary, transparent": film(substrate=1.52),
    "ordinary, normal incidence": film(angle=0.0),
    "zero thickness": film(thickness=0.0, layer=2.1 + 0.3j),
    "zero thickness, transparent": film(thickness=0.0),
    "thickness 1e-6 nm": film(thickness=1e-6, layer=2.1 + 0.3j),
    "thickness 3 nm of metal": film(thickness=3.0, layer=0.05 + 4j),
    "thickness 10 nm, weakly absorbing": film(thickness=10.0, layer=1.3 + 0.4j),
    "1 mm of k = 3": film(thickness=1e6, layer=2.9 + 3j),
    "1 mm transparent": film(thickness=1e6),
    "k = -0.0": film(layer=complex(1.46, -0.0)),
    "k = 1e-12": film(layer=1.46 + 1e-12j),
    "k = 1e-300": film(layer=1.46 + 1e-300j),
    "k = 1e-300, substrate too": film(layer=1.46 + 1e-300j, substrate=1.52 + 1e-300j),
    "89.999 degrees": film(layer=2.1 + 0.3j, angle=89.999),
    "89.999 degrees, transparent": film(substrate=1.52, angle=89.999),
    "exactly 90 degrees": film(layer=2.1 + 0.3j, angle=90.0),
    "exactly 90 degrees, transparent": film(substrate=1.52, angle=90.0),
    "film exactly critical": film(ambient=1.5, angle=30.0, layer=0.75, substrate=1.52),
    "film exactly critical, thick": film(
        ambient=1.5, angle=30.0, layer=0.75, substrate=1.52, thickness=2000.0
    ),
    "film nearly critical": film(ambient=1.5, angle=30.0, layer=0.7500001, substrate=1.52),
    "substrate exactly critical": film(ambient=1.5, angle=30.0, layer=1.46, substrate=0.75, smooth=False),
    "total reflection, 20 nm gap": film(ambient=1.52, layer=1.0, substrate=1.52, thickness=20.0),
    "total reflection, 200 nm gap": film(ambient=1.52, layer=1.0, substrate=1.52, thickness=200.0),
    "total reflection, 20 µm gap": film(ambient=1.52, layer=1.0, substrate=1.52, thickness=2e4),
    "total reflection in the substrate": film(ambient=1.52, layer=2.1, substrate=1.0),
    "total reflection under an absorbing film": film(ambient=1.52, layer=2.1 + 0.05j, substrate=1.0),
    "Kretschmann plasmon": film(
        ambient=1.515, layer=0.135 + 4.0j, substrate=1.0, thickness=48.0, angle=43.2, wavelength=633.0
    ),
    "film matched to the ambient": film(layer=1.0, substrate=1.52),
    "film matched to the substrate": film(layer=1.52, substrate=1.52),
    "film matched to both": film(layer=1.0, substrate=1.0, dark=True),
    "film matched to an absorbing substrate": film(layer=2.1 + 0.3j, substrate=2.1 + 0.3j),
    "n = 0.05 + 4i": film(layer=0.05 + 4j, thickness=40.0),
    "absorbing substrate": film(substrate=2 + 0.1j),
    "metal substrate": film(substrate=0.2 + 3.4j, thickness=100.0, angle=60.0),
    "ambient denser than the film": film(ambient=1.52, layer=1.33, substrate=1.7, angle=40.0),
    "wavelength 1e7 nm": film(layer=2.1 + 0.3j, wavelength=1e7),
    "wavelength 1 nm": film(layer=1.0 - 1e-3 + 1e-4j, substrate=0.999 + 1e-4j, wavelength=1.0, angle=20.0),
}


def signals(formula, p, dark, near=None):
    """Every signal by name; N, C and S in the convention of `pellicle.optics.ellipsometry`."""
    found = formula(p, near)
    (rs, Ts), (rp, Tp) = found["s"], found["p"]
    Rs, Rp = abs(rs) ** 2, abs(rp) ** 2
    if dark:
        return [Rs, Rp, Ts, Tp, mpf(0), mpf(0), mpf(0)]
    both = 2 * mp.conj(rp) * rs / (Rs + Rp)
    return [Rs, Rp, Ts, Tp, (Rs - Rp) / (Rs + Rp), mp.re(both), mp.im(both)]


def sizes(p):
    """What a rounding of each input is proportional to: an index is rounded as n + ik."""
    count = (len(p) - 5) // 3
    index = [abs(mpc(*nk)) for nk in zip(p[count : 2 * count], p[2 * count : 3 * count], strict=True)]
    below = abs(mpc(p[-5], p[-4]))
    return [*(abs(d) for d in p[:count]), *index, *index, below, below, *(abs(x) for x in p[-3:])]


def natural(p):
    """The slope of a film that changes a signal by 1 over a radian, for each parameter."""
    count, size = (len(p) - 5) // 3, sizes(p)
    k0 = 2 * mp.pi / p[-1]
    depths = [k0 * n for n in size[count : 2 * count]]
    return [*depths, *(1 / x for x in size[count : 3 * count + 3]), mp.pi / 180, 1 / p[-1]]


def row(name, given):
    p, dark = [mpf(x) for x in given["at"]], given["dark"]
    size, floor = sizes(p), natural(p)
    values = signals(by_matrix, p, dark)
    agree(name, values, signals(by_recursion, p, dark))
    out = given | {"value": [float(x) for x in values]}
    if not given["smooth"]:
        return out
    near = unpack(p, None)[2][-1]

    def by(formula):
        return lambda x: signals(formula, x, dark, near)

    first = differences(by(by_matrix), p)
    agree(name, chain(*first), chain(*differences(by(by_recursion), p)))
    out["slope"] = [[float(x) for x in column] for column in first]
    spread = [sum(s * abs(c[i]) for s, c in zip(size, first, strict=True)) for i in range(len(SIGNALS))]
    floors = [[f + abs(x) for x in column] for f, column in zip(floor, first, strict=True)]
    out["condition"] = [float(f"{float(1 + x):.3g}") for x in spread]
    out["slope_condition"] = conditions(by(by_matrix), p, floors, size)
    return out


def main():
    tables = {"films": FILMS, "stacks": STACKS}
    found = {key: {name: row(name, given) for name, given in cases.items()} for key, cases in tables.items()}
    text = json.dumps({"signals": SIGNALS, **found}).replace('}, "', '},\n"')
    Path(__file__).with_name("stacks.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
