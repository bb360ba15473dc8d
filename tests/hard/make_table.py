"""Writes table.json: R and T of hard cases with their derivatives, to 50 digits.

Two formulas that share nothing but Snell's law, the 2×2 transfer matrix (H. A. Macleod, Thin-Film
Optical Filters, chapter 2) and the sum over reflections (G. B. Airy, 1833), must agree to 1e-40
before a number is written. Run as `python tests/hard/make_table.py`.
"""

from __future__ import annotations

import json
from pathlib import Path

from mpmath import mp, mpc, mpf

mp.dps = 160
STEP = mpf(10) ** -40  # of the central difference: its error is of order 1e-80
NUDGE = mpf(10) ** -90  # of an index whose root is exactly 0, where both formulas are 0/0
AGREEMENT = mpf(10) ** -40

PARAMETERS = (
    "thickness",
    "layer_n",
    "layer_k",
    "substrate_n",
    "substrate_k",
    "ambient_n",
    "angle",
    "wavelength",
)


def case(
    thickness=137.0, layer=1.46, substrate=3.9 + 0.02j, ambient=1.0, angle=55.0, wavelength=550.0, smooth=True
):
    """One row: the exact floats of PARAMETERS, and whether the derivatives exist."""
    layer, substrate = complex(layer), complex(substrate)
    indices = (layer.real, layer.imag, substrate.real, substrate.imag)
    return {"at": [thickness, *indices, ambient, angle, wavelength], "smooth": smooth}


CASES = {
    "ordinary, absorbing film": case(layer=2.1 + 0.3j),
    "ordinary, transparent": case(substrate=1.52),
    "ordinary, normal incidence": case(angle=0.0),
    "zero thickness": case(thickness=0.0, layer=2.1 + 0.3j),
    "zero thickness, transparent": case(thickness=0.0),
    "thickness 1e-6 nm": case(thickness=1e-6, layer=2.1 + 0.3j),
    "thickness 3 nm of metal": case(thickness=3.0, layer=0.05 + 4j),
    "thickness 10 nm, weakly absorbing": case(thickness=10.0, layer=1.3 + 0.4j),
    "1 mm of k = 3": case(thickness=1e6, layer=2.9 + 3j),
    "1 mm transparent": case(thickness=1e6),
    "k = -0.0": case(layer=complex(1.46, -0.0)),
    "k = 1e-12": case(layer=1.46 + 1e-12j),
    "k = 1e-300": case(layer=1.46 + 1e-300j),
    "k = 1e-300, substrate too": case(layer=1.46 + 1e-300j, substrate=1.52 + 1e-300j),
    "89.999 degrees": case(layer=2.1 + 0.3j, angle=89.999),
    "89.999 degrees, transparent": case(substrate=1.52, angle=89.999),
    "exactly 90 degrees": case(layer=2.1 + 0.3j, angle=90.0),
    "exactly 90 degrees, transparent": case(substrate=1.52, angle=90.0),
    "film exactly critical": case(ambient=1.5, angle=30.0, layer=0.75, substrate=1.52),
    "film exactly critical, thick": case(
        ambient=1.5, angle=30.0, layer=0.75, substrate=1.52, thickness=2000.0
    ),
    "film nearly critical": case(ambient=1.5, angle=30.0, layer=0.7500001, substrate=1.52),
    "substrate exactly critical": case(ambient=1.5, angle=30.0, layer=1.46, substrate=0.75, smooth=False),
    "total reflection, 20 nm gap": case(ambient=1.52, layer=1.0, substrate=1.52, thickness=20.0),
    "total reflection, 200 nm gap": case(ambient=1.52, layer=1.0, substrate=1.52, thickness=200.0),
    "total reflection, 20 µm gap": case(ambient=1.52, layer=1.0, substrate=1.52, thickness=2e4),
    "total reflection in the substrate": case(ambient=1.52, layer=2.1, substrate=1.0),
    "total reflection under an absorbing film": case(ambient=1.52, layer=2.1 + 0.05j, substrate=1.0),
    "Kretschmann plasmon": case(
        ambient=1.515, layer=0.135 + 4.0j, substrate=1.0, thickness=48.0, angle=43.2, wavelength=633.0
    ),
    "film matched to the ambient": case(layer=1.0, substrate=1.52),
    "film matched to the substrate": case(layer=1.52, substrate=1.52),
    "film matched to both": case(layer=1.0, substrate=1.0),
    "film matched to an absorbing substrate": case(layer=2.1 + 0.3j, substrate=2.1 + 0.3j),
    "n = 0.05 + 4i": case(layer=0.05 + 4j, thickness=40.0),
    "absorbing substrate": case(substrate=2 + 0.1j),
    "metal substrate": case(substrate=0.2 + 3.4j, thickness=100.0, angle=60.0),
    "ambient denser than the film": case(ambient=1.52, layer=1.33, substrate=1.7, angle=40.0),
    "wavelength 1e7 nm": case(layer=2.1 + 0.3j, wavelength=1e7),
    "wavelength 1 nm": case(layer=1.0 - 1e-3 + 1e-4j, substrate=0.999 + 1e-4j, wavelength=1.0, angle=20.0),
}


def root(square, near=None):
    """√ with Im ≥ 0, or the root on the side of `near`: a derivative stays on one branch."""
    q = mp.sqrt(square)
    if near is not None:
        return q if abs(q - near) <= abs(q + near) else -q
    return -q if mp.im(q) < 0 else q


def media(p, near=None):
    """Permittivities, normal components of the index, and k₀d."""
    d, n1, k1, n2, k2, n0, angle, wavelength = p
    theta = angle * mp.pi / 180
    a, q0 = n0 * mp.sin(theta), n0 * mp.cos(theta)
    e1, e2 = mpc(n1, k1) ** 2, mpc(n2, k2) ** 2
    e1, e2 = (e + NUDGE if abs(e - a * a) < NUDGE else e for e in (e1, e2))
    return (n0**2, e1, e2), (q0, root(e1 - a * a), root(e2 - a * a, near)), 2 * mp.pi * d / wavelength


def by_matrix(p, near=None):
    """{Rs, Rp, Ts, Tp} from the characteristic matrix and the tilted admittances."""
    e, q, k0d = media(p, near)
    result = {}
    for letter in "sp":
        y = q if letter == "s" else [eps / normal for eps, normal in zip(e, q, strict=True)]
        cosine, sine = mp.cos(k0d * q[1]), mp.sin(k0d * q[1])
        electric = cosine - 1j * sine * y[2] / y[1]
        magnetic = -1j * y[1] * sine + y[2] * cosine
        below = abs(y[0] * electric + magnetic) ** 2
        result["R" + letter] = abs(y[0] * electric - magnetic) ** 2 / below
        result["T" + letter] = 4 * y[0] * mp.re(y[2]) / below
    return result


def by_sum(p, near=None):
    """The same from Fresnel's coefficients and the geometric series of reflections."""
    e, q, k0d = media(p, near)
    passage = mp.exp(1j * k0d * q[1])
    result = {}
    for letter in "sp":
        # in p the magnetic field carries the amplitude, u = ε_j q_i
        weight = (1, 1, 1) if letter == "s" else e
        r, t = [], []
        for i, j in ((0, 1), (1, 2)):
            u, v = weight[j] * q[i], weight[i] * q[j]
            r.append((u - v) / (u + v))
            t.append(2 * u / (u + v))
        echoes = 1 + r[0] * r[1] * passage**2
        reflected = (r[0] + r[1] * passage**2) / echoes
        passed = t[0] * t[1] * passage / echoes
        flux = [mp.re(normal / w) for normal, w in zip(q, weight, strict=True)]
        result["R" + letter] = abs(reflected) ** 2
        result["T" + letter] = abs(passed) ** 2 * flux[2] / flux[0]
    return result


def gradient(formula, p, near):
    """Central differences of every signal in every parameter, kept on the branch of `near`."""
    columns = []
    for i in range(len(p)):
        up, down = list(p), list(p)
        up[i], down[i] = p[i] + STEP, p[i] - STEP
        above, below = formula(up, near), formula(down, near)
        columns.append({name: (above[name] - below[name]) / (2 * STEP) for name in above})
    return {name: [column[name] for column in columns] for name in columns[0]}


def row(name, given):
    p = [mpf(x) for x in given["at"]]
    values, others = by_matrix(p), by_sum(p)
    near = media(p)[1][2]
    slopes = gradient(by_matrix, p, near) if given["smooth"] else {}
    other_slopes = gradient(by_sum, p, near) if given["smooth"] else {}
    for signal in values:
        pairs = [(values[signal], others[signal])]
        pairs += list(zip(slopes.get(signal, []), other_slopes.get(signal, []), strict=True))
        for one, two in pairs:
            if abs(one - two) > AGREEMENT * (1 + abs(one)):
                raise SystemExit(f"{name}, {signal}: the formulas differ by {mp.nstr(abs(one - two), 3)}")
    return given | {
        "value": {signal: float(value) for signal, value in values.items()},
        "gradient": {signal: [float(x) for x in column] for signal, column in slopes.items()},
    }


def main():
    table = {"parameters": PARAMETERS, "cases": {name: row(name, given) for name, given in CASES.items()}}
    Path(__file__).with_name("table.json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
