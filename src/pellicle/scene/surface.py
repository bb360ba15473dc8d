"""A surface as a recipe describes it: a BRDF by name, each of its keys fixed or free."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, final, runtime_checkable

import equinox as eqx
import numpy as np

from pellicle.brdf.directions import direction
from pellicle.brdf.models import Model, Parameter, model
from pellicle.data.brdf_samples import spread
from pellicle.errors import UsageError
from pellicle.scene.free import Free

LETTERS = ("r", "g", "b")


class FreeNumber(NamedTuple):
    """One free number: `n_g` of the key `n`, its bounds and how it is searched."""

    name: str
    key: str
    channel: int | None
    free: Free
    about: Parameter

    @property
    def log(self) -> bool:
        """Searched in its logarithm."""
        return self.about.log and self.free.lower > 0


@dataclass(frozen=True)
class Surface:
    """A BRDF by name and its numbers: `Surface("microfacet-film", {"thickness": Free(lower=0, upper=500)})`.

    Each key of `numbers` is a number, one number a channel, or a `Free`; a key per channel that is
    free becomes `n_r`, `n_g` and `n_b`. A key that is not given keeps the model's default, fixed.
    `wavelengths` (nm) has one for each channel of the samples. Raises UsageError for a name or key
    that is none, and for a count that does not match.
    """

    model: str
    numbers: Mapping[str, float | Sequence[float] | Free] = field(default_factory=dict)
    wavelengths: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        try:
            known = [p.key for p in self.brdf.parameters]
        except ValueError as error:
            raise UsageError(str(error)) from None
        for key, value in self.numbers.items():
            if key not in known:
                near = difflib.get_close_matches(key, known, 1)
                hint = f" (did you mean {near[0]!r}?)" if near else ""
                raise UsageError(f"{self.model} has no {key!r}{hint}; it has {', '.join(known)}")
            count = np.size(value) if not isinstance(value, Free) else 1
            if count not in (1, self.channels):
                raise UsageError(f"{key}: {count} numbers for {self.channels} wavelengths; give one or each")

    @property
    def brdf(self) -> Model:
        return model(self.model)

    @property
    def seen_at(self) -> tuple[float, ...]:
        """Wavelengths in nm, the model's own where none are given."""
        return self.brdf.wavelengths if self.wavelengths is None else tuple(self.wavelengths)

    @property
    def channels(self) -> int:
        return len(self.seen_at)

    def leaves(self) -> tuple[FreeNumber, ...]:
        """Every free number, in the model's order."""
        return tuple(leaf for about in self.brdf.parameters for leaf in self._of(about))

    def _of(self, about: Parameter) -> list[FreeNumber]:
        given = self.numbers.get(about.key)
        if not isinstance(given, Free):
            return []
        if not about.per_channel or self.channels == 1:
            return [FreeNumber(about.key, about.key, None, given, about)]
        names = LETTERS if self.channels == 3 else [str(c + 1) for c in range(self.channels)]
        return [FreeNumber(f"{about.key}_{name}", about.key, c, given, about) for c, name in enumerate(names)]

    def fixed(self) -> dict[str, np.ndarray]:
        """Every fixed number as an array () or (channels,), and the wavelengths."""
        found = {"wavelengths": np.array(self.seen_at)}
        for about in self.brdf.parameters:
            given: Any = self.numbers.get(about.key, about.value)
            if isinstance(given, Free):
                continue
            default = about.key not in self.numbers and about.per_channel
            found[about.key] = np.asarray(given[0] if default else given, dtype=float)
        return found

    def start(self) -> dict[str, np.ndarray]:
        """Every number as an array: fixed ones, and where free ones start."""
        free = {key: np.asarray(x.start) for key, x in self.numbers.items() if isinstance(x, Free)}
        return self.fixed() | free


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
class SurfaceView(eqx.Module):
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


def lit(surface: Surface, looked: HasDirections, most: int = MOST) -> SurfaceView:
    """The surface as seen along at most so many of these directions. UsageError for a black one."""
    numbers = present(surface)
    if not {"specular", "diffuse"} & numbers.keys():
        raise UsageError("there is nothing to compute: the surface sends no light back (specular, diffuse 0)")
    at = spread(len(looked.theta_i), most)
    i, o = (
        np.asarray(direction(theta[at], phi[at]))
        for theta, phi in ((looked.theta_i, looked.phi_i), (looked.theta_o, looked.phi_o))
    )
    return SurfaceView(surface.model, numbers, i, o)


def present(surface: Surface) -> dict[str, Any]:
    """The surface's numbers, some of them `Free`, but for effects that are fixed at zero: they are absent."""
    numbers: dict[str, Any] = dict(surface.fixed())
    gone = {key for key in ZERO_IS_ABSENT if key in numbers and not np.any(numbers[key])}
    gone |= {"azimuth"} if "deviation" in gone else set()
    for leaf in surface.leaves():
        numbers[leaf.key] = leaf.free if leaf.channel is None else [*numbers.get(leaf.key, []), leaf.free]
    return {key: x for key, x in numbers.items() if key not in gone}
