"""Samples and measurements that are not those of the scene that is fitted to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from families import FAMILIES
from family import Family, Theta, log_uniform
from measurement import Conditions, Stack, View
from media import Index, catalogued, cauchy, lorentz

Wrong = tuple[Stack, View, Conditions]


class WrongScene(NamedTuple):
    """A family whose recipe is fitted, and what is measured in truth."""

    name: str
    family: Family
    draw: Callable[[np.random.Generator, Family], Wrong]


def _on(
    index: Index | None = None,
    substrate: Index | None = None,
    *,
    thickness: tuple[float, float] | None = None,
    under: tuple[str, float] | None = None,
    over: tuple[str, float] | None = None,
    signal: str | None = None,
    angle: float | None = None,
    polarisation: str = "unpolarised",
    **conditions: float | bool,
) -> Callable[[np.random.Generator, Family], Wrong]:
    """A draw of the family's own sample with another film, substrate, layer (name, nm) or light."""

    def draw(random: np.random.Generator, family: Family) -> Wrong:
        theta: Theta = family.draw(random)
        if thickness is not None:
            theta = (log_uniform(random, *thickness), *theta[1:])
        own = family.stack(theta)
        film = own.layers[0] if index is None else (index, theta[0])
        above = [] if over is None else [(catalogued(over[0]), over[1] * random.uniform(0.7, 1.3))]
        below = [] if under is None else [(catalogued(under[0]), under[1] * random.uniform(0.7, 1.3))]
        stack = Stack(
            (*above, film, *below),
            own.substrate if substrate is None else substrate,
            film=len(above),
            plate_mm=own.plate_mm,
        )
        view = replace(family.view, polarisation=polarisation)
        if signal is not None:
            view = replace(view, signal=signal)
        if angle is not None:
            view = replace(view, angle=np.full(view.angle.shape, angle))
        return stack, view, replace(Conditions(), **conditions)

    return draw


NITRIDE, TITANIA, GLASS = catalogued("Si3N4"), cauchy(2.25, 3e4), catalogued("BK7")
ALUMINIUM, SILICON = catalogued("Al"), catalogued("Si")
ABSORBING = lorentz(2.3, 0.6, 2.4, 0.8)

_SCENES: tuple[tuple[str, str, Callable[[np.random.Generator, Family], Wrong]], ...] = (
    ("film index +25 %", "oxide-R", _on(film_factor=1.25, thickness=(150, 1000))),
    ("film index +25 %", "oxide-psi", _on(film_factor=1.25, thickness=(40, 500))),
    ("film index +25 %", "oxide-psi3", _on(film_factor=1.25, thickness=(40, 500))),
    ("film index -20 %", "nitride-R", _on(film_factor=0.8, thickness=(150, 800))),
    ("film index +25 %", "coat-R", _on(film_factor=1.25)),
    ("nitride on glass as oxide on silicon", "oxide-R", _on(NITRIDE, GLASS)),
    ("nitride on glass as oxide on silicon", "oxide-psi", _on(NITRIDE, GLASS, thickness=(40, 500))),
    ("nitride on glass as oxide on silicon", "oxide-psi3", _on(NITRIDE, GLASS, thickness=(40, 500))),
    ("wrong substrate: glass for silicon", "resist-R", _on(substrate=GLASS)),
    ("wrong substrate: glass for silicon", "polymer-psi3", _on(substrate=GLASS)),
    ("wrong substrate: aluminium for silicon", "resist-R", _on(substrate=ALUMINIUM)),
    ("wrong substrate: aluminium for silicon", "oxide-psi3", _on(substrate=ALUMINIUM)),
    ("missing layer: 100 nm nitride under", "oxide-R", _on(under=("Si3N4", 100))),
    ("missing layer: 100 nm oxide under", "nitride-R", _on(under=("SiO2", 100))),
    ("missing layer: 60 nm nitride over", "oxide-psi", _on(over=("Si3N4", 60))),
    ("missing layer: 100 nm oxide under", "polymer-psi3", _on(under=("SiO2", 100))),
    ("missing layer: 20 nm chromium over", "titania-T", _on(over=("Cr", 20))),
    ("reflectance fitted as T", "titania-T", _on(signal="R")),
    ("transmittance fitted as R", "absorber-R", _on(signal="T")),
    ("angle off by 5°", "oxide-psi", _on(thickness=(40, 500), angle_error=-5.0)),
    ("angle off by 5°", "oxide-psi3", _on(thickness=(40, 500), angle_error=5.0)),
    ("angle off by 5°", "polymer-psi3", _on(angle_error=-5.0)),
    ("percent of percent", "oxide-R", _on(factor=0.01)),
    ("percent of percent", "titania-T", _on(factor=0.01)),
    ("absorbing film as transparent", "resist-R", _on(ABSORBING)),
    ("absorbing film as transparent", "polymer-psi3", _on(ABSORBING)),
    ("gold film as oxide", "oxide-R", _on(catalogued("Au"), thickness=(30, 80))),
    ("titania film as gold", "gold-T", _on(TITANIA, thickness=(60, 200))),
    ("thicker than the bounds", "nitride-R", _on(thickness=(3000, 6000))),
    ("thicker than the bounds", "oxide-psi3", _on(thickness=(1500, 3000))),
    ("p light at 60° as normal incidence", "oxide-R", _on(angle=60.0, polarisation="p")),
    ("reversed wavelengths", "nitride-R", _on(reverse=True)),
    ("reversed wavelengths", "polymer-psi3", _on(reverse=True)),
    ("film index +25 %", "soap-R", _on(film_factor=1.25)),
    ("titania on silicon as a soap film", "soap-R", _on(TITANIA, SILICON)),
)

WRONG_SCENES = tuple(WrongScene(name, FAMILIES[family], draw) for name, family, draw in _SCENES)
