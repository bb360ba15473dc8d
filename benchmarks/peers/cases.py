"""Hard cases for every package: one layer on a half space."""

from __future__ import annotations

import math

PARAMETERS = (
    "thickness",  # nm
    "layer_n",
    "layer_k",
    "substrate_n",
    "substrate_k",
    "ambient_n",
    "angle",  # degrees
    "wavelength",  # nm
)
FREE = ("thickness", "layer_n", "layer_k", "substrate_n", "angle")
"""Parameters of the derivatives; the angle is in degrees."""

SIGNALS = ("Rs", "Rp", "Ts", "Tp")

Case = dict[str, float]


def _case(thickness=137.0, layer=1.46, substrate=1.52, ambient=1.0, angle=55.0, wavelength=550.0):
    layer, substrate = complex(layer), complex(substrate)
    media = (layer.real, layer.imag, substrate.real, substrate.imag)
    return dict(zip(PARAMETERS, (thickness, *media, ambient, angle, wavelength), strict=True))


_PRISM = {"ambient": 1.52, "layer": 1.0}
_CRITICAL = {"ambient": 1.5, "angle": 30.0}

CASES: dict[str, Case] = {
    "ordinary, transparent film": _case(),
    "ordinary, absorbing film": _case(layer=2.1 + 0.3j),
    "ordinary, normal incidence": _case(layer=2.1 + 0.3j, angle=0.0),
    "no film, d = 0": _case(thickness=0.0, layer=2.1 + 0.3j),
    "d = 1e-6 nm": _case(thickness=1e-6, layer=2.1 + 0.3j),
    "d = 20 µm": _case(thickness=2e4, layer=1.46 + 1e-3j),
    "k = −0.0": _case(layer=complex(1.46, -0.0)),
    "k = 1e-12": _case(layer=1.46 + 1e-12j),
    "k = 1e-300": _case(layer=1.46 + 1e-300j),
    "metal film, 40 nm of 0.05 + 4i": _case(layer=0.05 + 4j, thickness=40.0),
    "film matched to the ambient": _case(layer=1.0),
    "film matched to the substrate": _case(layer=1.52),
    "1 mm of k = 3": _case(thickness=1e6, layer=2.9 + 3j),
    "1 mm, transparent": _case(thickness=1e6),
    "silicon substrate, 3.9 + 0.02i": _case(substrate=3.9 + 0.02j),
    "absorbing substrate, 2 + 0.1i": _case(substrate=2 + 0.1j),
    "metal substrate, 0.2 + 3.4i": _case(substrate=0.2 + 3.4j, thickness=100.0, angle=60.0),
    "89.999°": _case(layer=2.1 + 0.3j, angle=89.999),
    "exactly 90°": _case(layer=2.1 + 0.3j, angle=90.0),
    "total reflection, 200 nm gap": _case(**_PRISM, thickness=200.0),
    "total reflection, 20 µm gap": _case(**_PRISM, thickness=2e4),
    "total reflection in the substrate": _case(ambient=1.52, layer=2.1, substrate=1.0),
    "total reflection under an absorbing film": _case(ambient=1.52, layer=2.1 + 0.05j, substrate=1.0),
    "Kretschmann plasmon": _case(
        ambient=1.515, layer=0.135 + 4.0j, substrate=1.0, thickness=48.0, angle=45.0, wavelength=633.0
    ),
    "film exactly critical": _case(**_CRITICAL, layer=0.75),
    "film critical to the last bit": _case(**_CRITICAL, layer=1.5 * math.sin(math.radians(30.0))),
    "substrate exactly critical": _case(**_CRITICAL, substrate=0.75),
}

WITHOUT_SLOPE = ("substrate exactly critical",)
"""Cases in which the derivatives with respect to n₂ and the angle are infinite."""
