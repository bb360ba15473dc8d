"""A scene: what is there and how it is looked at.

Scenes are pytrees of numbers. Wherever a number may stand, a `Free` may stand instead: a
parameter to be fitted. What is absent is None, and costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple, final

import equinox as eqx
import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.scene.free import Free
from pellicle.scene.instrument import Instrument
from pellicle.scene.layers import Interface, Layer, Plate, Substrate, absorbs, surroundings

SIGNALS = ("R", "T", "psi-delta")
POLARISATIONS = ("unpolarised", "s", "p")


@final
class Light(eqx.Module):
    """How the scene is looked at: signal "R", "T" or "psi-delta", polarisation, angle of incidence
    (degrees; one for all or one per wavelength) and wavelengths (nm; None leaves them to the data)."""

    wavelength: Any = None
    angle: Any = 0.0
    signal: str = eqx.field(static=True, default="R")
    polarisation: str = eqx.field(static=True, default="unpolarised")

    def __check_init__(self):
        if self.signal not in SIGNALS:
            raise ValueError(f"signal must be one of {', '.join(SIGNALS)}, not {self.signal!r}")
        check_polarisation(self.polarisation)
        angle = [self.angle.lower, self.angle.upper] if isinstance(self.angle, Free) else self.angle
        if isinstance(angle, int | float | list | np.ndarray):
            wrong = [x for x in np.ravel(angle) if not 0 <= x <= 90]
            if wrong:
                raise ValueError(f"the angle of incidence must lie in 0 to 90 degrees, got {wrong[0]:g}")

    @property
    def largest_angle(self) -> float:
        """The largest angle of incidence, in degrees, that values or bounds allow."""
        return float(self.angle.upper if isinstance(self.angle, Free) else np.max(self.angle))


def check_polarisation(polarisation: str) -> None:
    """ValueError unless the word is one that we know."""
    if polarisation not in POLARISATIONS:
        raise ValueError(f"polarisation must be one of {', '.join(POLARISATIONS)}, not {polarisation!r}")


def _layers(what: Layer | Sequence[Layer | Interface | Plate]) -> tuple[Layer | Interface | Plate, ...]:
    return (what,) if isinstance(what, Layer) else tuple(what)


@final
class Scene(eqx.Module):
    """Layers on a substrate, the medium they are seen from, the light and the instrument.

    `layers` is one `Layer`, or several from the ambient down, with an `Interface` or a `Plate` among
    them where there is one.

    ```python
    pl.Scene(pl.Layer("SiO2", thickness=pl.Free(lower=10, upper=3000)), substrate="Si")
    ```

    Raises ValueError where the ambient absorbs, where there is no layer, or where what is asked for
    has no meaning together.
    """

    layers: tuple[Layer | Interface | Plate, ...] = eqx.field(converter=_layers)
    substrate: Substrate = eqx.field(converter=lambda s: s if isinstance(s, Substrate) else Substrate(s))
    ambient: AbstractDispersion = eqx.field(converter=surroundings, default=1.0)
    light: Light = Light()
    instrument: Instrument = Instrument()

    def __check_init__(self):
        if not self.layers:
            raise ValueError("a scene needs at least one layer; a bare surface is a layer of thickness 0")
        if any(isinstance(a, Interface) and isinstance(b, Interface) for a, b in pairwise(self.layers)):
            raise ValueError("two interfaces lie on each other: an interface mixes the media at its sides")
        if absorbs(self.ambient):
            raise ValueError("the ambient must not absorb: give it a real index")
        self._check_instrument()

    def _check_instrument(self):
        if self.instrument.thickness_spread is not None:
            if len(self.layers) > 1:
                raise ValueError("with several layers give each its own thickness_spread, not the instrument")
            only = [x for x in self.layers if isinstance(x, Layer) and x.thickness_spread is None]
            if not only:
                raise ValueError("thickness_spread is given twice, or for what is no coherent layer")
        if self.instrument.has_cone:
            half = math.degrees(self.instrument.largest_half_angle(1.0))
            if self.light.largest_angle + half > 90:
                raise ValueError(
                    f"the light's cone reaches beyond 90 degrees: {self.light.largest_angle:g} and a half "
                    f"angle of {half:.3g}"
                )


class Group(NamedTuple):
    """Coherent layers between two thick media, and what roughens each face from the top down."""

    above: AbstractDispersion
    layers: tuple[Layer, ...]
    below: AbstractDispersion
    roughness: tuple[Any, ...]


def groups(scene: Scene) -> tuple[tuple[Group, ...], tuple[Plate, ...]]:
    """The coherent groups from the ambient down, and the plates between them."""
    plates = _plates(scene)
    runs: list[list[Layer]] = [[]]
    for position, item in enumerate(scene.layers):
        if isinstance(item, Plate):
            runs.append([])
        elif isinstance(item, Layer):
            runs[-1].append(item)
        else:
            runs[-1].extend(item.slices(*_neighbours(scene, position)))
    foot = len(runs) - 1  # the group that ends on the substrate's upper face
    if scene.substrate.back is not None:
        runs.append([])
    last = scene.substrate.material if scene.substrate.back is None else scene.substrate.back
    media = [scene.ambient, *(plate.material for plate in plates), last]
    feet = [scene.substrate.roughness if i == foot else None for i in range(len(runs))]
    found = [
        Group(above, tuple(run), below, (*(layer.roughness for layer in run), foot))
        for above, run, below, foot in zip(media[:-1], runs, media[1:], feet, strict=True)
    ]
    return tuple(found), plates


def _plates(scene: Scene) -> tuple[Plate, ...]:
    own = tuple(layer for layer in scene.layers if isinstance(layer, Plate))
    substrate = scene.substrate
    return own if substrate.back is None else (*own, Plate(substrate.material, substrate.plate_mm))


def _neighbours(scene: Scene, position: int) -> tuple[AbstractDispersion, AbstractDispersion]:
    media = [scene.ambient, *(getattr(x, "material", None) for x in scene.layers), scene.substrate.material]
    above, below = media[position], media[position + 2]
    assert above is not None and below is not None  # two interfaces never meet  # noqa: PT018
    return above, below


def coherent_layers(scene: Scene) -> tuple[Layer, ...]:
    """Every coherent layer from the ambient down, interfaces as their slices."""
    return tuple(layer for group in groups(scene)[0] for layer in group.layers)


def thickness_spread(scene: Scene, layer: Layer) -> Any:
    """The standard deviation of a layer's thickness (nm): its own, or the instrument's; None if even."""
    return scene.instrument.thickness_spread if layer.thickness_spread is None else layer.thickness_spread


def with_wavelength(scene: Scene, wavelength: Any, angle: Any = None) -> Scene:
    """The same scene looked at at other wavelengths (nm), and angles (degrees) if given."""
    angle = scene.light.angle if angle is None else angle
    light = Light(wavelength, angle, scene.light.signal, scene.light.polarisation)
    return eqx.tree_at(lambda s: s.light, scene, light)
