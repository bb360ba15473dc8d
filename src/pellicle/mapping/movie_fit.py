"""Fit of the places of a movie around their paths, and of the gain and dark level that they share.

The state-space smoother joins all times of a place. What gain and dark level change in its thickness gives
the information on them of all places together, with each thickness free to follow (marginal likelihood): from
paths alone, whose errors blur the fringes, a gain was 0.5 to 7 % too small.

**Source:** of `state_space`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pellicle.fitting.noise import correlation_length
from pellicle.mapping.movie_light import FilmLight
from pellicle.mapping.movie_paths import PlacePath
from pellicle.mapping.state_space import Quadratics, Smoothed, smooth
from pellicle.mapping.thinning_law import Looks
from pellicle.mapping.trace_light import Light
from pellicle.scene.free import SLOWLY

_PASSES, _SETTLED = 6, 0.05
"""Most passes of the smoother, and the change of all thicknesses, in standard errors, that ends them."""
_SHORT = 1 / 12
"""Largest change of a thickness in a pass, in orders."""
_MODEL = 0.005
"""Error of the model as a share of the range of the light."""
_LEVEL = 0.005
"""Error of gain and dark level by the instrument, relative and as a share of the range of the light."""
_ROUNDS, _STEADY = 6, 0.1
"""Most rounds for the gain, and the change of all numbers, in standard errors, that ends them."""
_EDGE = 0.15
"""Step of a path at the border of the black film, in orders, at which the rate starts anew."""


class Levels(NamedTuple):
    """Gain and dark level (channels, 2); how errors change the gains, then the dark levels (2 channels,
    effects): first those by the noise, 2 channels, then those of the instrument; the stiffness of places."""

    gain: np.ndarray
    effects: np.ndarray
    like: Smoothed | None = None

    @property
    def by_noise(self) -> slice:
        """The effects that are by the noise."""
        return slice(0, 2 * len(self.gain))

    @property
    def of_instrument(self) -> slice:
        """The other effects."""
        return slice(2 * len(self.gain), None)


class PlaceFit(NamedTuple):
    """Smoothed thickness of a place, in the unit of the grid of the film; the thickness (times,) in nm around
    which its light is linear, its slope (times, channels) and weights, the residual there, and changes of
    the light by effects (times, channels, effects)."""

    smoothed: Smoothed
    film: FilmLight
    point: np.ndarray
    slope: np.ndarray
    weight: np.ndarray
    residual: np.ndarray
    pushed: np.ndarray

    @property
    def scale(self) -> float:
        """Range of the thickness in nm."""
        return float(self.film.grid[-1] - self.film.grid[0])

    @property
    def thickness(self) -> np.ndarray:
        """Thickness (times,) in nm."""
        return self.film.grid[0] + self.scale * self.smoothed.mean[:, 0]

    def columns(self, levels: Levels) -> dict[str, np.ndarray]:
        """Thickness and rate with their errors by the noise, and by the instrument, (times,) each."""
        own, scale = self.smoothed, self.scale
        columns = {"thickness": self.thickness, "rate": scale * own.rate[:, 0]}
        every = ("", own.variance, own.changes), ("rate_", own.rate_variance, own.rate_changes)
        for name, variance, changes in every:
            noise, common = (
                np.sum(changes[:, 0, some] ** 2, axis=1) for some in (levels.by_noise, levels.of_instrument)
            )
            columns[f"{name}noise"] = scale * np.sqrt(variance[:, 0] + noise)
            columns[f"{name}common"] = scale * np.sqrt(common)
        return columns

    def looks(self, relative: float) -> Looks:
        """The thickness by each time alone; `relative` is the error that all thicknesses have in common."""
        weighted = self.weight * self.slope
        information = np.sum(weighted * self.slope, axis=1)
        information = np.maximum(information, 1e-9 * information.max())
        value = self.point + np.sum(weighted * self.residual, axis=1) / information
        pushed = np.einsum("tb,tbe->te", weighted, self.pushed) / information[:, None]
        common = np.column_stack([pushed, relative * self.thickness])
        return Looks(value, information**-0.5, common)

    def evidence(self) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (effects,) and information (effects, effects) on the effects, thicknesses being free."""
        step = self.thickness - self.point
        left = self.residual - self.slope * step[:, None]
        followed = self.scale * self.slope[..., None] * self.smoothed.changes[:, 0][:, None]
        gradient = np.einsum("tb,tbe,tb->e", self.weight, self.pushed, left)
        return gradient, np.einsum("tb,tbe,tbf->ef", self.weight, self.pushed, self.pushed - followed)


def levels_of(lights: list[Light], paths: list[PlacePath], film: FilmLight, gain: np.ndarray) -> Levels:
    """Fit gain and dark level to the light of some places, from the surest one on, around their paths."""
    span, like = lights[0].span, None
    every, places = np.eye(gain.size), list(zip(lights, paths, strict=True))
    # the stiffness of the place that changes most is enough for the others
    places.sort(key=lambda place: -np.abs(np.diff(place[1].thickness)).sum())
    covariance = np.zeros_like(every)
    for _ in range(_ROUNDS):
        found = []
        for light, path in places:
            found.append(smoothed_place(light, path, film, Levels(gain, every, like)))
            like = like or found[-1].smoothed
        places = [
            (light, path._replace(thickness=fit.thickness))
            for (light, path), fit in zip(places, found, strict=True)
        ]
        evidence = [fit.evidence() for fit in found]
        gradient, information = (sum(some) for some in zip(*evidence, strict=True))
        # the first gain is right within its own size, the dark level within the range of the light
        prior = np.concatenate([gain[:, 0], span]) ** -2.0
        covariance = np.linalg.inv(information + np.diag(prior))
        step = covariance @ gradient
        gain = gain + step.reshape(2, -1).T
        if np.max(np.abs(step) / np.sqrt(np.diagonal(covariance))) < _STEADY:
            break
    half, none = np.linalg.cholesky(covariance), np.zeros(len(gain))
    beside = _LEVEL * np.stack([np.append(gain[:, 0], none), np.append(none, span)], axis=1)
    return Levels(gain, np.concatenate([half, beside], axis=1), like)


def smoothed_place(light: Light, path: PlacePath, film: FilmLight, levels: Levels) -> PlaceFit:
    """Fit the thickness of a place by all its times together."""
    low, scale, gain = film.grid[0], film.grid[-1] - film.grid[0], levels.gain
    thickness = path.thickness.copy()
    known = np.asarray(np.isfinite(light.values).all(axis=1))
    breaks = np.zeros(len(thickness), bool)
    if path.black is not None and path.black > 0:
        near = thickness[max(path.black - 2, 0) : path.black + 2]
        breaks[path.black] = np.ptp(near) > _EDGE * film.order
    steps = np.abs(np.diff(thickness)) / (np.diff(light.time) / np.median(np.diff(light.time)))
    fastest = 10 * float(steps.max()) / scale + 1e-6
    weight = known[:, None] / (light.noise**2 + (_MODEL * light.span) ** 2)
    made, limit, fit = levels.like, _SHORT * film.order, None
    for number in range(_PASSES):
        reflected, slope = film.at(thickness), gain[:, 0] * film.slope(thickness)
        residual = np.nan_to_num(light.values - gain[:, 0] * reflected - gain[:, 1])
        if number == 2:
            square = np.sum(residual**2, axis=0) / max(known.sum(), 1)
            together = np.array([correlation_length(column) for column in residual[known].T])
            weight = known[:, None] / np.maximum(square * together, light.noise**2)
        each = np.eye(len(gain))
        changes = np.concatenate(
            [reflected[..., None] * each, np.broadcast_to(each, (len(reflected), *each.shape))], 2
        )
        pushed = changes @ levels.effects
        information = (scale**2 * np.sum(weight * slope**2, axis=1))[:, None, None]
        pull = scale * np.sum(weight * slope * residual, axis=1)[:, None]
        pushes = scale * np.einsum("tb,tb,tbe->te", weight, slope, pushed)[:, None]
        vector = information[..., 0] * ((thickness - low) / scale)[:, None] + pull
        again = levels.like is None and number in (0, 2)
        quadratics = Quadratics(vector, information, pushes)
        made = smooth(light.time, quadratics, (SLOWLY,), breaks, fastest, None if again else made)
        fit = PlaceFit(made, film, thickness, slope, weight, residual, pushed)
        step, error = fit.thickness - thickness, scale * np.sqrt(np.maximum(made.variance[:, 0], 1e-30))
        thickness = np.clip(thickness + np.clip(step, -limit, limit), low, film.grid[-1])
        if number > 2 and np.max(np.abs(step) / error) < _SETTLED:
            break
    assert fit is not None
    return fit
