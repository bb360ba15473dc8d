"""Dispersion models of a film that is in no catalogue, with the bounds of their free numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.oscillators import Drude, Lorentz, Oscillators
from pellicle.recipes.dispersion_models import MODELS, build_model

CONDUCTOR = "drude with lorentz"
"""Free charges beside the dispersion of a transparent film, as indium tin oxide and doped zinc oxide have."""
_WIDER = {("cauchy", "B"): 2e5, ("sellmeier", "B1"): 10.0, ("sellmeier", "C1"): 1e5}
"""Upper bounds of models beyond those of a fit: rutile has 1.0e5, 6.1 and 6.3e4 from 450 to 950 nm."""
FREE_MODELS: dict[str, dict[str, tuple[float, float]]] = {
    name: {key: (x.lower, _WIDER.get((name, key), x.upper)) for key, x in specs.items() if x.free}
    for name, specs in MODELS.items()
} | {
    # two pages of ITO have 1.04, 1.6, 2.1, 4.6, 0.2 and 1.85, 0.02, 2.8, 7.3, 0.06 within 0.006 and 0.0005
    # from 450 to 950 nm; eps_inf is 1, which A and E0 make up for
    CONDUCTOR: {
        "term1.Ep": (0.0, 4.0),
        "term1.gamma": (0.01, 4.0),
        "term2.A": (0.3, 10.0),
        "term2.E0": (3.5, 10.0),
        "term2.gamma": (0.01, 4.0),
    }
}
"""Models by name, with the bounds of their free numbers by their names in a fit of one layer."""


def built(name: str, values: Mapping[str, Any]) -> AbstractDispersion:
    """Build a model of `FREE_MODELS` from its numbers."""
    if name != CONDUCTOR:
        return build_model(name, values)
    numbers = [values[key] for key in FREE_MODELS[CONDUCTOR]]
    return Oscillators(1.0, (Drude(*numbers[:2]), Lorentz(*numbers[2:])))
