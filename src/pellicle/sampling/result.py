"""Results of sampling: draws of the posterior, and the data that they predict."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, cast

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.brdf.view import INVERSES, RESIDUALS, SamplesView
from pellicle.fitting.curves import BrdfCurve, ColourCurve, Curve
from pellicle.fitting.evaluation import curves
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.problem import Problem
from pellicle.fitting.report_methods import PlotMixin
from pellicle.fitting.result import Fit, Part, Status
from pellicle.sampling.chain import Checks
from pellicle.sampling.density import Modes

DRAWS = 256
"""Curves behind a band: 2.5 % of them are six."""


class Axis(NamedTuple):
    """Abscissa of data: its name in files, its label in figures, and its values (points,)."""

    name: str
    label: str
    values: np.ndarray


class Prediction(NamedTuple):
    """One measured quantity: `data` (points,), and draws from the posterior, (draws, points): `model`, and
    `noisy`, as it would be measured again; `measured` is the data set. `decades` says that it spans several,
    `wraps` that it is an angle that goes on at 0 behind 360 degrees."""

    name: str
    label: str
    axis: Axis
    data: np.ndarray
    model: np.ndarray
    noisy: np.ndarray
    measured: Spectrum | Colours | BrdfSamples | None = None
    decades: bool = False
    wraps: bool = False


def predictions(
    problem: Problem, parts: tuple[Part, ...], units: np.ndarray, seed: int
) -> tuple[Prediction, ...]:
    """Predictions of each quantity of spectra, and of each channel of colours and of BRDF samples.

    `units` are draws (steps, walkers, parameters) in the unit cube of an affine problem.
    """
    random, flat = np.random.default_rng(seed), units.reshape(-1, units.shape[-1])
    drawn = flat[random.integers(len(flat), size=DRAWS)]
    with jax.enable_x64(True):
        values = np.asarray(problem.values(drawn))
        result: list[Prediction] = []
        for view, part in zip(problem.views, parts, strict=True):
            model = np.asarray(curves(view.form, view.arrays, problem.seen_by(view, values)).model)
            result += _OF[type(part.curve)](view, part, model, random)
        return tuple(result)


def _names(part: Part) -> tuple[str, str]:
    """Prefix of labels and suffix of names of a part among several."""
    return (f"{part.name}: ", f"_{part.name}") if part.name else ("", "")


def _spectrum(
    view: SpectrumView, part: Part, model: np.ndarray, random: np.random.Generator
) -> list[Prediction]:
    model = model[:, : view.points]
    sigma = 1 / np.asarray(view.data.weight)[: view.points]
    noisy = model + sigma * random.standard_normal(model.shape)
    curve, (prefix, suffix) = part.spectral, _names(part)
    axis = Axis(f"wavelength_nm{suffix}", "wavelength (nm)", curve.wavelength)
    drawn, again = (view.signal.in_quantities(view.in_columns(columns)) for columns in (model, noisy))
    predicted = []
    for i, q in enumerate(view.signal.quantities):
        numbers = q.curve(curve)[0], drawn[..., i], again[..., i]
        about = {"measured": part.data, "wraps": q.wraps}
        predicted.append(Prediction(q.name + suffix, prefix + q.axis, axis, *numbers, **about))
    return predicted


def _samples(
    view: SamplesView, part: Part, model: np.ndarray, random: np.random.Generator
) -> list[Prediction]:
    """One for each channel, its samples from the darkest to the brightest of the fitted surface."""
    rows, samples, residual = slice(view.rows), view.data, view.form.residual
    model = model[:, rows]
    where = samples.i[rows, 2:3], samples.floor[rows]
    compared = RESIDUALS[residual](model, *where)
    compared = compared + random.standard_normal(model.shape) / np.asarray(samples.weight)[rows]
    noisy = np.asarray(INVERSES[residual](compared, *where))
    rank = part.curve.model.argsort(axis=0).argsort(axis=0)
    prefix, suffix = _names(part)
    predicted = []
    for c, name in enumerate(cast(BrdfSamples, part.data).channels):
        at = Axis(f"rank_{name}{suffix}", "samples, from the darkest to the brightest", rank[:, c])
        numbers = part.data.values[:, c], model[..., c], noisy[..., c]
        label = f"{prefix}{name} (1/sr)"
        predicted.append(Prediction(name + suffix, label, at, *numbers, part.data, decades=True))
    return predicted


def _colours(
    view: ColoursView, part: Part, model: np.ndarray, random: np.random.Generator
) -> list[Prediction]:
    """One for each channel, against the angle of incidence or the number of the colour."""
    data = cast(Colours, part.data)
    model = view.encoded(model)
    noisy = model + data.noise * random.standard_normal(model.shape)
    prefix, suffix = _names(part)
    at = Axis(f"colour{suffix}", "colour", np.arange(1.0, len(data) + 1))
    if data.angle is not None:
        at = Axis(f"angle_deg{suffix}", "angle of incidence (degrees)", data.angle)
    return [
        Prediction(name + suffix, prefix + name, at, data.values[:, c], model[..., c], noisy[..., c], data)
        for c, name in enumerate(data.channels)
    ]


_OF = {Curve: _spectrum, ColourCurve: _colours, BrdfCurve: _samples}
"""Predictions of a part, by the kind of its curve."""


@dataclass(frozen=True)
class Mode:
    """One minimum as one parameter sees it: the median of the draws there, and their share."""

    value: float
    mass: float


@dataclass(frozen=True)
class Marginal:
    """The posterior of one parameter, in its own unit: moments, quantiles of 2.5, 50 and 97.5 %, modes."""

    name: str
    unit: str
    mean: float
    sd: float
    q025: float
    q50: float
    q975: float
    modes: tuple[Mode, ...]


@dataclass(frozen=True, repr=False)
class Posterior(PlotMixin):
    """Draws from the posterior of a fit's free parameters; a spectrum's scale and offset are integrated out.

    `draws` (steps, walkers, parameters) in the parameters' own units, without burn-in, `log_density`
    (steps, walkers) beside them. `parameters` holds each one's marginal, or nothing where the checks do
    not carry an interval: `checks.doubts` says why. `units` is the same as `draws` between 0 and 1.
    `assumption` is what the posterior assumes though the fit does not show it; empty if nothing.
    """

    fit: Fit
    names: tuple[str, ...]
    draws: np.ndarray
    units: np.ndarray
    log_density: np.ndarray
    modes: Modes
    checks: Checks
    predict: Callable[[np.ndarray, int], tuple[Prediction, ...]]
    seconds: float
    assumption: str = ""

    def predictions(self, seed: int = 0) -> tuple[Prediction, ...]:
        """Posterior predictions of each measured quantity."""
        return self.predict(self.units, seed)

    @property
    def trusted(self) -> bool:
        return self.checks.trusted

    @cached_property
    def parameters(self) -> dict[str, Marginal]:
        """Marginals by name, the thickness first; empty where the chain is not to be trusted."""
        return self.marginals() if self.trusted else {}

    def marginals(self) -> dict[str, Marginal]:
        """Marginals by name, whatever the checks say."""
        columns = dict(zip(self.names, self.draws.reshape(-1, len(self.names)).T, strict=True))
        home = self.modes.nearest(self.units.reshape(-1, len(self.names)))
        members, result = [home == mode for mode in np.unique(home)], {}
        for name, p in self.fit.parameters.items():
            if (values := columns.get(name)) is not None:
                places = [Mode(float(np.median(values[own])), float(np.mean(own))) for own in members]
                figures = values.mean(), values.std(ddof=1), *np.quantile(values, [0.025, 0.5, 0.975])
                ranked = tuple(sorted(places, key=lambda mode: -mode.mass))
                result[name] = Marginal(name, p.unit, *map(float, figures), modes=ranked)
        return result

    def __getitem__(self, name: str) -> Marginal:
        return self.parameters[name]

    def __str__(self) -> str:
        lines = [
            f"  {m.name} = {m.q50:.6g} ({m.q025:.6g} to {m.q975:.6g}) {m.unit}".rstrip()
            for m in self.parameters.values()
        ]
        return "\n".join([verdict(self), *lines])

    __repr__ = __str__


def verdict(posterior: Posterior) -> str:
    """One or two sentences: what the posterior adds, or why it may not be used."""
    checks = posterior.checks
    if not checks.trusted:
        return f"The chain does not carry an interval: {'; '.join(checks.doubts)}."
    lead = next(iter(posterior.parameters.values()))
    unit = f" {lead.unit}" if lead.unit else ""
    misfit = posterior.fit.status is Status.MISFIT
    assumption = "the scene explained the data, which it does not" if misfit else posterior.assumption
    opening = f"If {assumption}, with" if assumption else "With"
    sentence = (
        f"{opening} 95 % probability {lead.name} lies between {lead.q025:.5g} and {lead.q975:.5g}{unit}"
    )
    several = [mode for mode in lead.modes if mode.mass >= 0.05]
    if len(several) < 2:
        return f"{sentence}."
    shares = ", ".join(f"{mode.value:.5g}{unit} with {100 * mode.mass:.0f} %" for mode in several)
    return f"{sentence}, in {len(several)} separate places: {shares}."
