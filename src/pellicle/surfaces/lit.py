"""A surface and the directions that it is seen along: what a plan of a surface is made for."""

from __future__ import annotations

from typing import Any, Protocol, final, runtime_checkable

import equinox as eqx
import numpy as np

from pellicle.brdf.directions import direction
from pellicle.brdf.models import Model, model
from pellicle.errors import UsageError
from pellicle.io.samples import spread
from pellicle.surfaces.surface import Surface

MOST = 256
"""Pairs of directions that a plan compares models at, spread over those given."""
LAYERED = ("granier-heidrich-diffuse", "granier-heidrich-full")
"""Models whose diffuse part has met the layer."""
ZERO_IS_ABSENT = ("k", "base_k", "deviation", "specular", "diffuse")


@runtime_checkable
class HasDirections(Protocol):
    """Degrees from the normal and around it, each (samples,): `Directions` or `BrdfSamples`."""

    @property
    def theta_i(self) -> np.ndarray: ...
    @property
    def phi_i(self) -> np.ndarray: ...
    @property
    def theta_o(self) -> np.ndarray: ...
    @property
    def phi_o(self) -> np.ndarray: ...


@final
class Lit(eqx.Module):
    """Numbers of a BRDF's model, some of them `Free`, and unit vectors to light and eye (samples, 3).

    What is fixed at zero is not among `numbers`. A number a channel is an array, or a list where it is
    free. The rest is what a plan may leave out that has no number of its own.
    """

    model: str = eqx.field(static=True)
    numbers: dict[str, Any]
    i: Any
    o: Any
    coherent: bool = eqx.field(static=True, default=True)
    oblique: bool = eqx.field(static=True, default=True)
    polarisation: str = eqx.field(static=True, default="unpolarised")

    @property
    def brdf(self) -> Model:
        return model(self.model)

    @property
    def layered(self) -> bool:
        """Whether anything of the layer is seen: a grey diffuse part alone shows none."""
        return "specular" in self.numbers or self.model in LAYERED

    @property
    def channels(self) -> int:
        return np.shape(self.numbers["wavelengths"])[0]


def lit(surface: Surface, looked: HasDirections, most: int = MOST) -> Lit:
    """The surface as seen along at most so many of these directions. UsageError for a black one."""
    numbers = present(surface)
    if not {"specular", "diffuse"} & numbers.keys():
        raise UsageError("there is nothing to compute: the surface sends no light back (specular, diffuse 0)")
    at = spread(len(looked.theta_i), most)
    i, o = (
        np.asarray(direction(theta[at], phi[at]))
        for theta, phi in ((looked.theta_i, looked.phi_i), (looked.theta_o, looked.phi_o))
    )
    return Lit(surface.model, numbers, i, o)


def present(surface: Surface) -> dict[str, Any]:
    """The surface's numbers, some of them `Free`, but for effects that are fixed at zero: they are absent."""
    numbers: dict[str, Any] = dict(surface.fixed())
    gone = {key for key in ZERO_IS_ABSENT if key in numbers and not np.any(numbers[key])}
    gone |= {"azimuth"} if "deviation" in gone else set()
    for leaf in surface.leaves():
        numbers[leaf.key] = leaf.free if leaf.channel is None else [*numbers.get(leaf.key, []), leaf.free]
    return {key: x for key, x in numbers.items() if key not in gone}
