"""Writes table.json: R and T of hard cases with their derivatives, to 50 digits; see `stack_truth`.

Run as `python tests/hard/make_table.py`.
"""

import json
from pathlib import Path

from mpmath import mpf
from stack_truth import agree, by_matrix, by_recursion, differences, unpack

SIGNALS = ("Rs", "Ts", "Rp", "Tp")

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


def row(name, given):
    p = [mpf(x) for x in given["at"]]
    near = unpack(p, None)[2][-1]

    def signals(formula, p, near=None):
        return [x for r, T in formula(p, near).values() for x in (abs(r) ** 2, T)]

    values = signals(by_matrix, p)
    agree(name, values, signals(by_recursion, p))
    slopes = []
    if given["smooth"]:
        slopes, others = (
            differences(lambda x, formula=formula: signals(formula, x, near), p)
            for formula in (by_matrix, by_recursion)
        )
        for one, other in zip(slopes, others, strict=True):
            agree(name, one, other)
    columns = zip(*slopes, strict=True) if slopes else []
    return given | {
        "value": {signal: float(value) for signal, value in zip(SIGNALS, values, strict=True)},
        "gradient": {s: [float(x) for x in c] for s, c in zip(SIGNALS, columns, strict=bool(slopes))},
    }


def main():
    table = {"parameters": PARAMETERS, "cases": {name: row(name, given) for name, given in CASES.items()}}
    Path(__file__).with_name("table.json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
