"""Parameters of published figures, as (name of the model, parameters)."""

from __future__ import annotations

from typing import Any

_PHONG = {
    "thickness": 71.0,
    "n": (1.4, 1.45, 1.6),
    "exponent_reflection": 90.0,
    "exponent_transmission": 170.0,
    "azimuth": 0.0,
    "specular": 1.0,
}

PRESETS: dict[str, tuple[str, dict[str, Any]]] = {
    "granier-heidrich figure 3, parallel": (
        "granier-heidrich-full",
        _PHONG | {"deviation": 0.0, "diffuse": 0.7},
    ),
    "granier-heidrich figure 3, deviated": (
        "granier-heidrich-full",
        _PHONG | {"deviation": 10.0, "diffuse": 0.7},
    ),
    "granier-heidrich figure 4": ("granier-heidrich", _PHONG | {"deviation": 10.0, "diffuse": 0.0}),
    "tempered steel": (
        "microfacet-film",
        {
            "thickness": 40.0,
            "n": 2.9,
            "k": 0.0,
            "base_n": 2.7,
            "base_k": 2.8,
            "roughness": 0.2,
            "multiple_scattering": 0.0,
            "specular": 1.0,
            "diffuse": 0.0,
        },
    ),
}
"""The thickness is the middle of the published range: Granier and Heidrich vary it from 66 to
76 nm in their figures 3 and 4; the figure of tempered steel, from 10 to 70 nm."""
