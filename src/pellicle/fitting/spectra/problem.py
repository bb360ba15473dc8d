"""Spectra of a sample and their scenes as numbers: what is simulated, and what it is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.effects.bounds import largest_index
from pellicle.effects.plan import Plan
from pellicle.fitting.spectra.nuisance import Data
from pellicle.fitting.spectra.parameters import Parameter, anonymous, bounds, shared
from pellicle.fitting.spectra.targets import Measured, Noise
from pellicle.planning.differences import largest_difference, signals
from pellicle.planning.film import plan, reference
from pellicle.scene.film import Scene, coherent_layers, with_wavelength
from pellicle.scene.priors import LogUniform, Prior
from pellicle.simulation.film import sampled

_STAY = ("precision", "dispersion")
"""What a tolerance leaves alone: a fit stops by differences below single precision, and its media are
evaluated once in any case."""

_ROUND = 64
"""Spectra are padded to a multiple of this, so that files of nearly one length share a program."""


class Box(NamedTuple):
    """Bounds and priors; the search lives in the unit cube between the bounds.

    Normal and half-normal priors have a mean and a weight; `logarithmic` is 1 for a log-uniform one, which
    posteriors count and fits do not.
    """

    lower: Any
    upper: Any
    prior_mean: Any
    prior_weight: Any  # 1/sd, 0 for none
    logarithmic: Any

    def values(self, unit):
        return self.lower + unit * (self.upper - self.lower)


def boxed(lower: np.ndarray, upper: np.ndarray, priors: Sequence[Prior | None]) -> Box:
    """The box between bounds (parameters,), with the prior of each parameter."""
    rows = [prior.mean_and_weight if prior else (0.0, 0.0) for prior in priors]
    logarithmic = np.array([float(isinstance(prior, LogUniform)) for prior in priors])
    mean, weight = np.reshape(rows, (-1, 2)).T
    return Box(lower, upper, mean, weight, logarithmic)


class View(NamedTuple):
    """One spectrum of a problem: what is simulated, and what it is compared with.

    `scene` has anonymous free parameters and sampled media; `takes` says which of the problem's
    parameters they are. A prior is in the `box` of the first view that holds its parameter.
    """

    name: str  # empty where there is no other
    plan: Plan
    scene: Scene
    data: Data
    box: Box
    takes: tuple[int, ...]
    noise: Noise
    points: int  # data values: N, C, S, or N and C, for each wavelength in ellipsometry
    largest_index: float

    @property
    def channels(self) -> int:
        """Data values at each wavelength."""
        return len(self.data.values) // len(self.scene.light.wavelength)

    @property
    def rows(self) -> int:
        """Wavelengths that are real, not padding."""
        return self.points // self.channels

    @property
    def independent(self) -> int:
        """Data values that are independent: N, C and S lie on a sphere, so two of the three."""
        return self.points if self.channels < 3 else 2 * self.rows

    def in_columns(self, values: Any) -> np.ndarray:
        """Data values or a model of them (..., data values) as signals, or as N, C and S, of the real points,
        (..., rows, channels)."""
        values = np.asarray(values)[..., : self.points]
        columns = values.reshape(*values.shape[:-1], self.rows, self.channels)
        if self.data.frame is None:
            return columns
        return np.einsum("pij,...pi->...pj", np.asarray(self.data.frame)[: self.rows], columns)

    def rms(self, model: Any) -> float:
        """rms of the residuals. For ellipsometry it is in degrees of Ψ: half the distance on the sphere, in
        each of its two directions."""
        residual = (self.data.values - np.asarray(model))[: self.points]
        if self.channels == 1:
            return float(np.sqrt(np.mean(residual**2)))
        return float(np.rad2deg(np.sqrt(residual @ residual / (2 * self.rows))) / 2)

    @property
    def program(self) -> tuple[Any, ...]:
        """The arguments that the compiled functions take, the plan first (static)."""
        return self.plan.static_key, self.scene, self.data, self.box


class Problem(NamedTuple):
    """Everything about one fit: the spectra of a sample, and the parameters that explain them all."""

    views: tuple[View, ...]
    box: Box
    parameters: tuple[Parameter, ...]

    @property
    def thickness_axis(self) -> int | None:
        """Which thickness is scanned finely: the one with the widest bounds, None where all are fixed."""
        spans = {i: p.upper - p.lower for i, p in enumerate(self.parameters) if p.key == "thickness"}
        return max(spans, key=lambda i: spans[i]) if spans else None

    @property
    def shortest(self) -> float:
        """The shortest wavelength (nm) inside a layer that any spectrum and the bounds allow."""
        return min(v.scene.light.wavelength.min() / v.largest_index for v in self.views)

    @property
    def program(self) -> tuple[Any, ...]:
        """The arguments of `polish`, what is static first."""
        looks = tuple((v.plan.static_key, v.takes) for v in self.views)
        return looks, tuple(v.scene for v in self.views), tuple(v.data for v in self.views), self.box


def make(*spectra: Measured, tolerance: float = 0.0) -> Problem:
    """The problem of explaining these spectra of one sample, with models that are off by up to `tolerance`.

    Raises ValueError where a material has no data at a wavelength.
    """
    scenes, names = [m.scene for m in spectra], [m.name for m in spectra]
    free, held = shared(scenes, names)
    box = boxed(*bounds(free), [p.prior for p in free])
    views, told = [], set()
    for spectrum, takes in zip(spectra, held, strict=True):
        first = np.array([i not in told for i in takes], dtype=float)
        told |= set(takes)
        own = Box(*(column[list(takes)] for column in box))
        views.append(_view(spectrum, own._replace(prior_weight=own.prior_weight * first), takes, tolerance))
    return Problem(tuple(views), box, free)


def _view(spectrum: Measured, box: Box, takes: tuple[int, ...], tolerance: float) -> View:
    scene, wavelength, values = spectrum.scene, spectrum.wavelength, spectrum.values
    points, channels = len(wavelength), values.size // len(wavelength)
    extra = -points % _ROUND
    wavelength, values = _pad(wavelength, extra), _pad(values, extra)
    scene = with_wavelength(scene, wavelength, _pad_angle(scene.light.angle, extra))
    chosen = plan(scene, tolerance, _STAY)
    span = max(wavelength.max() - wavelength.min(), 1e-9)  # one wavelength at many angles has none
    sigma = np.reshape(spectrum.sigma, (-1, 1)) if np.ndim(spectrum.sigma) < 2 else spectrum.sigma
    weight = np.concatenate([1 / np.broadcast_to(sigma, (points, channels)), np.zeros((extra, channels))])
    data = Data(
        values=values.reshape(-1),
        weight=weight.reshape(-1),
        position=np.repeat(2 * (wavelength - wavelength.min()) / span - 1, channels),
        independent_fraction=np.float64(spectrum.independent_fraction),
        level=np.float64(max(float(np.median(np.abs(values[:points]))), 1e-12)),
        frame=None if spectrum.frame is None else _pad(spectrum.frame, extra),
    )
    scene = sampled(scene, chosen.on("coherence") or scene.instrument.wavelength_shift is not None)
    steepest = max((largest_index(x.material, wavelength) for x in coherent_layers(scene)), default=1.0)
    return View(
        spectrum.name,
        chosen,
        anonymous(scene),
        data,
        box,
        takes,
        spectrum.noise,
        points * channels,
        steepest,
    )


def beyond(view: View, unit: np.ndarray) -> float:
    """How far the view's plan is off at one point of the unit cube, in the unit of its signal."""
    if not view.plan.tolerance:
        return 0.0
    at = np.asarray(view.box.values(unit[list(view.takes)]))[None]
    planned, whole = (signals(p, view.scene, at) for p in (view.plan, reference(view.scene)))
    return largest_difference(planned, whole, view.plan.signal)


def _pad(x: np.ndarray, extra: int) -> np.ndarray:
    return np.concatenate([x, np.repeat(x[-1:], extra, axis=0)])


def _pad_angle(angle: Any, extra: int) -> Any:
    return _pad(angle, extra) if np.ndim(angle) else angle


def thin(view: View, most: int) -> View:
    """Every so-many-th wavelength, at most about `most`, with the weight of those left out."""
    stride = -(-view.rows // most)
    if stride <= 1:
        return view
    size, channels = len(view.scene.light.wavelength), view.channels
    kept = np.arange(0, view.rows, stride)
    padding = -len(kept) % _ROUND
    take = np.concatenate([kept, np.full(padding, size - 1)])

    def pick(x):
        if np.ndim(x) not in (1, 3) or len(x) not in (size, size * channels):
            return x
        taken = x.reshape(size, -1)[take]
        return taken.reshape(-1) if np.ndim(x) == 1 else taken.reshape(-1, *x.shape[1:])

    scene, data = jax.tree_util.tree_map(pick, (view.scene, view.data))
    real = np.repeat(np.concatenate([np.ones(len(kept)), np.zeros(padding)]), channels)
    data = data._replace(weight=data.weight * real, independent_fraction=data.independent_fraction * stride)
    return view._replace(scene=scene, data=data, points=len(kept) * channels)
