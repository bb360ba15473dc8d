"""Flaws of real instruments and samples, each of everyday size, drawn at random."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from families import FIXED
from family import Family, Theta
from measurement import Conditions
from media import bruggeman, catalogued

SILICA, SILICON = catalogued("SiO2"), catalogued("Si")
SUBOXIDE = bruggeman(SILICA, SILICON, 0.5)


class Drawing(NamedTuple):
    """What a flaw is drawn for: random numbers, the sample, and a factor of its size."""

    random: np.random.Generator
    family: Family
    theta: Theta
    part: float

    def size(self, nominal: float) -> float:
        """Half to one and a half times the nominal size."""
        return float(self.part * nominal * self.random.uniform(0.5, 1.5))

    def signed(self, nominal: float) -> float:
        """The same with a random sign."""
        return float(self.size(nominal) * self.random.choice([-1.0, 1.0]))


class Flaw(NamedTuple):
    """Which families can have a flaw, and how it changes the conditions."""

    concerns: Callable[[Family], bool]
    draw: Callable[[Drawing], dict]


def _power(family: Family) -> bool:
    return family.view.signal != "psi-delta" and not family.counts


def _ellipsometric(family: Family) -> bool:
    return family.view.signal == "psi-delta"


def _has(*traits: str) -> Callable[[Family], bool]:
    return lambda family: set(traits) <= family.traits


def _drift(d: Drawing) -> dict:
    """Gain that drifts smoothly by 2 %."""
    return {"drift": d.size(0.02), "drift_shape": tuple(d.random.normal(size=4) / [1, 1, 2, 4])}


def _lamp_structure(d: Drawing) -> dict:
    """Lamp and detector structure of 3 % that a cubic does not follow."""
    return {"drift": d.size(0.03), "drift_shape": (*np.zeros(4), *d.random.normal(size=4))}


def _wavelength(d: Drawing) -> dict:
    """Wavelengths off by half a nanometre, shifted and stretched."""
    return {"shift": d.signed(0.5), "stretch": d.signed(0.25)}


def _slit(d: Drawing) -> dict:
    """A slit of 2 nm; for an instrument whose bandwidth is fitted, a window of another shape."""
    if "bandwidth" in d.family.traits:
        return {"slit": 1.7 * d.theta[1], "slit_shape": "rectangle"}
    return {"slit": d.size(2.0)}


def _roughness(d: Drawing) -> dict:
    """3 nm rms, less on a film too thin for it."""
    return {"roughness": min(d.size(3.0), d.theta[0] / 8)}


def _spread(d: Drawing) -> dict:
    """3 % of the thickness; at most 12 nm, beyond which thick films have no fringes."""
    return {"spread": d.size(min(0.03 * d.theta[0], 12.0))}


def _interlayer(d: Drawing) -> dict:
    """A native oxide of 2 nm under a film on silicon; 1 nm of suboxide under an oxide."""
    if "on-silicon" in d.family.traits:
        return {"interlayer": SILICA, "interlayer_nm": d.size(2.0)}
    return {"interlayer": SUBOXIDE, "interlayer_nm": d.size(1.0)}


def _dispersion(d: Drawing) -> dict:
    """A weak resonance beyond the violet, of which Cauchy has neither index nor absorption; within the
    visible for a film of one oscillator."""
    energy, width = (3.6, 0.25) if _index(d) < 1.9 else (3.4, 0.3)
    if "lorentz" in d.family.traits:
        energy, width = 2.2, 0.2
    return {"absorption": (d.size(0.012), energy * d.random.uniform(0.97, 1.03), width)}


def _index(d: Drawing) -> float:
    return float(d.family.stack(d.theta).layers[0][0](np.array([600.0]))[0].real)


def _cone(d: Drawing) -> dict:
    """A numerical aperture of 0.1 at normal incidence, focusing by 2° at an ellipsometer."""
    return {"cone": d.size(2.0 if _ellipsometric(d.family) else 5.7)}


def _step(d: Drawing) -> dict:
    """A step of the baseline by 1 % where the detector changes."""
    return {"step": d.signed(0.01), "step_at": float(d.random.uniform(600, 850))}


def _spikes(d: Drawing) -> dict:
    """Three points that are 10 to 20 standard deviations off."""
    rows = d.random.choice(d.family.view.wavelength.size, 3, replace=False)
    return {"spikes": tuple((int(row), d.size(15.0)) for row in sorted(rows))}


FLAWS = {
    "lamp-drift": Flaw(_power, _drift),
    "lamp-structure": Flaw(_has("counts"), _lamp_structure),
    "wavelength": Flaw(lambda family: True, _wavelength),
    "slit": Flaw(lambda family: True, _slit),
    "roughness": Flaw(_has("solid"), _roughness),
    "spread": Flaw(lambda family: True, _spread),
    "film-index": Flaw(_has(FIXED), lambda d: {"film_factor": 1 + d.signed(0.01)}),
    "substrate-index": Flaw(_has("solid"), lambda d: {"substrate_factor": 1 + d.signed(0.01)}),
    "interlayer": Flaw(lambda family: 'substrate = "Si"' in family.recipe, _interlayer),
    "dispersion": Flaw(lambda family: bool(family.traits & {"cauchy", "lorentz"}), _dispersion),
    "cone": Flaw(lambda family: True, _cone),
    "stray-light": Flaw(_power, lambda d: {"stray": d.size(0.01)}),
    "offset": Flaw(_power, lambda d: {"offset": d.size(0.005)}),
    "nonlinearity": Flaw(
        lambda family: not _ellipsometric(family), lambda d: {"nonlinearity": d.signed(0.02)}
    ),
    "detector-step": Flaw(lambda family: not _ellipsometric(family), _step),
    "angle": Flaw(_ellipsometric, lambda d: {"angle_error": d.signed(0.1)}),
    "psi-delta-offset": Flaw(
        _ellipsometric, lambda d: {"psi_offset": d.signed(0.1), "delta_offset": d.signed(0.3)}
    ),
    "depolarisation": Flaw(_ellipsometric, lambda d: {"depolarisation": d.size(0.01)}),
    "spikes": Flaw(lambda family: True, _spikes),
}

HIDDEN = {
    "contamination": lambda d: {"overlayer_nm": float(d.random.uniform(1.0, 2.5))},
    "pores": lambda d: {"pores": 0.06},
}
"""Flaws of thin films that scale, offset and index together may hide."""

SEVERAL = "several"
"""Three flaws at once, each of half its size, as most measurements have them."""


def flaws_of(family: Family) -> list[str]:
    """Names of the flaws that a family can have, `SEVERAL` the last."""
    return [*(name for name, flaw in FLAWS.items() if flaw.concerns(family)), SEVERAL]


def drawn(name: str, random: np.random.Generator, family: Family, theta: Theta) -> Conditions:
    """The conditions of a measurement with one flaw, or several."""
    if name in HIDDEN:
        return replace(Conditions(), **HIDDEN[name](Drawing(random, family, theta, 1.0)))
    if name != SEVERAL:
        return replace(Conditions(), **FLAWS[name].draw(Drawing(random, family, theta, 1.0)))
    names = [each for each in flaws_of(family) if each != SEVERAL]
    conditions = Conditions()
    for i in sorted(random.choice(len(names), 3, replace=False)):
        conditions = replace(conditions, **FLAWS[names[i]].draw(Drawing(random, family, theta, 0.5)))
    return conditions
