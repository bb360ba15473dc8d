"""Light of a film in a movie: its model, what is not the film, and the black film that anchors the order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.cameras import Sight
from pellicle.errors import UsageError
from pellicle.fitting.robust_losses import MAD_TO_SIGMA
from pellicle.mapping.trace_light import Light
from pellicle.scene.film import Scene
from pellicle.scene.free import Free
from pellicle.simulation.colours import interference_spectra, varied_layer

BLACK = 30.0
"""Largest thickness of a black film in nm: common and Newton black films have 5 to 30 nm."""
_STEP = 2.5
"""Thicknesses of the model, in nm: a fiftieth of a quarter wave."""
_STAYS, _STAYS_DARKER, _FEWEST = 4.0, 3.0, 8
"""Light of one wavelength that stays dark so many times as long as it took to fall from 0.8 of the brightest,
or so many times and gets no brighter again, is that of a black film. A dark fringe of a higher order passes
after 1.8 times where a film thins exponentially, 2.8 times as t^(-1/2), 3.7 times as t^(-1/4). The least
number of frames."""
_FRONT = 0.15
"""Fall of the light from one frame to the next, in shares of the brightest, at the edge of a black film: no
other edge in a film that drains is sharp."""
_DARKEST = 0.25
"""Share of the light of the thickest black film below which light gets no brighter again."""
_FALL = 0.8
_JUMP, _MORE, _AROUND = 0.15, 4.0, 4
"""A frame at which half of the places change by more than this share of the range of the light, and by so
many times the median of so many frames on each side, does not show the film of the frame before."""
_SHORT = 0.1
"""Share of the frames between two such jumps that are left out, and not a film of their own."""


_GONE, _NOISY = 0.9, 0.03
"""Share of the light that is dark where the film is gone, and room for noise, in shares of its range."""


class FilmLight(NamedTuple):
    """Light of a film of each thickness `grid` (nodes,) in nm: `table` (nodes, channels), 1 for white.

    `order` is the distance of two thicknesses that look alike, in nm; `black` is true where the film is
    darkest without thickness, as between two sides of one medium.
    """

    grid: np.ndarray
    table: np.ndarray
    order: float
    black: bool

    def at(self, thickness: np.ndarray) -> np.ndarray:
        """Light (..., channels) at thicknesses (...)."""
        return np.stack([np.interp(thickness, self.grid, column) for column in self.table.T], axis=-1)

    def slope(self, thickness: np.ndarray) -> np.ndarray:
        """Change of the light (..., channels) by 1 nm."""
        rise = np.gradient(self.table, self.grid, axis=0)
        return np.stack([np.interp(thickness, self.grid, column) for column in rise.T], axis=-1)


def film_light(scene: Scene, seen: Sight | None, wavelength: float | None) -> FilmLight:
    """Return the light of a scene in a camera, or behind a filter of a wavelength in nm.

    **Raises:** UsageError for a thickness that is not free, and for several angles.
    """
    bounds: Any = getattr(scene.layers[varied_layer(scene)], "thickness", None)
    angle: Any = scene.light.angle
    if not isinstance(bounds, Free):
        raise UsageError("the thickness of a movie must be free, between two bounds")
    if np.ndim(angle):
        raise UsageError("a movie has one angle of incidence: give the scene one number as `angle`")
    grid = np.linspace(bounds.lower, bounds.upper, max(int((bounds.upper - bounds.lower) / _STEP), 8) + 1)
    if wavelength is not None:
        nm, weights, channels = np.array([wavelength]), np.ones((1, 1)), np.eye(1)
    else:
        assert seen is not None
        (nm, weights), channels = seen.sensor, seen.coding.linear
    spectra = interference_spectra(scene, nm, grid, np.array([float(getattr(angle, "start", angle))]))[0]
    table = np.maximum(np.asarray(spectra) @ weights @ channels.T, 0.0)  # a camera has no negative light
    middle = table[:, table.shape[1] // 2]
    tops = grid[1:-1][(middle[1:-1] > middle[:-2]) & (middle[1:-1] >= middle[2:])]
    order = float(np.median(np.diff(tops))) if len(tops) > 1 else float(np.ptp(grid))
    dark = table[0] <= table.min(axis=0) + 0.02 * np.ptp(table, axis=0)
    return FilmLight(grid, table, order, bool(np.all(dark)) and bounds.lower < BLACK)


def noise_of(light: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Noise and range (channels,) of light (times, places, channels) whose coding has this `step`."""
    second = np.abs(light[2:] - 2 * light[1:-1] + light[:-2]).reshape(-1, light.shape[2])
    span = np.maximum(np.subtract(*np.nanpercentile(light, [99.5, 0.5], axis=(0, 1))), 1e-9)
    noise = MAD_TO_SIGMA * np.nanmedian(second, axis=0) / np.sqrt(6)
    return np.maximum(noise, step / np.sqrt(12) + 1e-4 * span), span


def parts_of(light: np.ndarray, time: np.ndarray, span: np.ndarray) -> tuple[list[range], np.ndarray]:
    """Ranges of frames that show one film, and frames (times,) that show none of it: a shutter, a flash."""
    change = np.max(np.abs(np.diff(light, axis=0)) / span, axis=2)
    usual = np.nanmedian(change, axis=1) if change.size else np.zeros(0)
    around = [usual[max(i - _AROUND, 0) : i + _AROUND + 1] for i in range(len(usual))]
    steps = np.diff(time) / np.median(np.diff(time))  # a film moves on while frames are missing
    limit = [max(_JUMP, _MORE * float(np.nanmedian(x)) * step) for x, step in zip(around, steps, strict=True)]
    jumps = [int(i) + 1 for i in np.flatnonzero(usual > limit)]
    out = np.zeros(len(light), bool)
    for first, after in pairwise(jumps):
        if after - first < _SHORT * len(light):
            out[first:after] = True
    kept = [i for i in jumps if not (out[i] or out[i - 1])]
    return [range(a, b) for a, b in pairwise([0, *kept, len(light)])], out


def black_from(
    lights: Sequence[Light], shape: tuple[int, ...], film: FilmLight, gain: np.ndarray
) -> dict[int, int]:
    """The frame from which each place is black to the end, of those that are: they stay dark in all channels
    for longer than a fringe would, or are dark at the end beside such a place."""
    if not film.black:
        return {}
    dark = {p: found for p, light in enumerate(lights) if (found := _dark(light, film, gain)) is not None}
    waiting = [p for p, (_, stays) in dark.items() if stays]
    black = set(waiting)
    while waiting:
        for q in neighbours(waiting.pop(), shape):
            if q in dark and q not in black:
                black.add(q)
                waiting.append(q)
    return {p: dark[p][0] for p in sorted(black)}


def is_gone(light: np.ndarray, film: FilmLight, gain: np.ndarray, span: np.ndarray) -> bool:
    """True for light (times, places, channels) after a jump that is dark at all places: the film broke."""
    limit = film.at(np.array(BLACK)) * gain[:, 0] + gain[:, 1]
    return film.black and bool(np.nanmean(np.all(light < limit + _NOISY * span, axis=2)) > _GONE)


def _dark(light: Light, film: FilmLight, gain: np.ndarray) -> tuple[int, bool] | None:
    """The frame from which a place is dark to the end, and whether it stays so for longer than at a fringe;
    None where it is not dark."""
    known = np.flatnonzero(np.isfinite(light.values).all(axis=1))
    level = (light.values[known] - gain[:, 1]) / gain[:, 0]
    limit = film.at(np.array(BLACK))
    bright = np.flatnonzero(np.any(level > limit + 3 * light.noise / np.abs(gain[:, 0]), axis=1))
    start = int(bright[-1]) + 1 if bright.size else 0
    dark = len(known) - start
    if dark < _FEWEST:
        return None
    if film.table.shape[1] > 1:  # no other thickness is dark in all colours
        return int(known[start]), True
    time, shown = light.time[known], level[:, 0]
    fall = np.flatnonzero(shown > _FALL * film.table.max())
    if not fall.size:
        return int(known[start]), False
    before = np.abs(np.diff(shown[max(start - 1 - _FEWEST, 0) : start]))
    sudden = shown[start - 1] - shown[start]
    if sudden > _FRONT * film.table.max() and sudden > _MORE * np.median(before):
        return int(known[start]), True  # the front of a black film
    stays = (time[-1] - time[start]) / (time[start] - time[fall[-1]])
    end, before = np.mean(shown[-(dark // 4) :]), np.mean(shown[start : start + dark // 4])
    darker = end < _DARKEST * limit[0] and end < before
    return int(known[start]), bool(stays > _STAYS or (darker and stays > _STAYS_DARKER))


def neighbours(place: int, shape: tuple[int, ...]) -> Iterator[int]:
    """The places beside one, flat over `shape`."""
    at = np.array(np.unravel_index(place, shape))
    for axis in range(len(shape)):
        for step in (-1, 1):
            there = at + step * (np.arange(len(shape)) == axis)
            if np.all((there >= 0) & (there < shape)):
                yield int(np.ravel_multi_index(tuple(there), shape))
