"""Posterior predictions of the data."""

from __future__ import annotations

from typing import NamedTuple, cast

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.fitting.brdf.view import INVERSES, RESIDUALS, SamplesView
from pellicle.fitting.curves import BrdfCurve, ColourCurve, Curve
from pellicle.fitting.evaluation import curves
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.problem import Problem
from pellicle.fitting.result import Part

DRAWS = 256
"""Curves behind a band: 2.5 % of them are six."""


class Axis(NamedTuple):
    """Abscissa of data: its name in files, its label in figures, and its values (points,)."""

    name: str
    label: str
    values: np.ndarray


class Prediction(NamedTuple):
    """One measured quantity: `data` (points,), and draws from the posterior, (draws, points): `model`, and
    `noisy`, as it would be measured again; `decades` says that it spans several."""

    name: str
    label: str
    axis: Axis
    data: np.ndarray
    model: np.ndarray
    noisy: np.ndarray
    decades: bool = False


def chosen(units: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """`DRAWS` draws (draws, parameters) from those of a chain (steps, walkers, parameters)."""
    flat = units.reshape(-1, units.shape[-1])
    return flat[random.integers(len(flat), size=DRAWS)]


def predictions(
    problem: Problem, parts: tuple[Part, ...], units: np.ndarray, seed: int
) -> tuple[Prediction, ...]:
    """Predictions of each quantity of spectra, and of each channel of colours and of BRDF samples.

    `units` are draws (steps, walkers, parameters) in the unit cube of an affine problem.
    """
    random = np.random.default_rng(seed)
    drawn = chosen(units, random)
    with jax.enable_x64(True):
        values = np.asarray(problem.values(drawn))
        pairs = zip(problem.views, parts, strict=True)
        result: list[Prediction] = []
        for view, part in pairs:
            model = np.asarray(curves(view.form, view.arrays, problem.seen_by(view, values)).model)
            result += _OF[type(part.curve)](view, part, model, random)
        return tuple(result)


def _spectrum(
    view: SpectrumView, part: Part, model: np.ndarray, random: np.random.Generator
) -> list[Prediction]:
    model = model[:, : view.points]
    sigma = 1 / np.asarray(view.data.weight)[: view.points]
    noisy = model + sigma * random.standard_normal(model.shape)
    curve, (prefix, suffix) = part.spectral, (f"{part.name}: ", f"_{part.name}") if part.name else ("", "")
    axis = Axis(f"wavelength_nm{suffix}", "wavelength (nm)", curve.wavelength)
    drawn, again = (view.signal.in_quantities(view.in_columns(columns)) for columns in (model, noisy))
    return [
        Prediction(q.name + suffix, prefix + q.axis, axis, q.curve(curve)[0], drawn[..., i], again[..., i])
        for i, q in enumerate(view.signal.quantities)
    ]


def _samples(
    view: SamplesView, part: Part, model: np.ndarray, random: np.random.Generator
) -> list[Prediction]:
    """One for each channel, its samples from the darkest to the brightest of the fitted surface."""
    rows, samples, residual = slice(view.rows), view.samples, view.form.residual
    model = model[:, rows]
    where = samples.i[rows, 2:3], samples.floor[rows]
    compared = RESIDUALS[residual](model, *where)
    compared = compared + random.standard_normal(model.shape) / np.asarray(samples.weight)[rows]
    noisy = np.asarray(INVERSES[residual](compared, *where))
    rank = part.curve.model.argsort(axis=0).argsort(axis=0)
    prefix, suffix = (f"{part.name}: ", f"_{part.name}") if part.name else ("", "")
    channels = cast(BrdfSamples, part.data).channels
    return [
        Prediction(
            name + suffix,
            f"{prefix}{name} (1/sr)",
            Axis(f"rank_{name}{suffix}", "samples, from the darkest to the brightest", rank[:, c]),
            part.data.values[:, c],
            model[..., c],
            noisy[..., c],
            decades=True,
        )
        for c, name in enumerate(channels)
    ]


def _colours(
    view: ColoursView, part: Part, model: np.ndarray, random: np.random.Generator
) -> list[Prediction]:
    """One for each channel, against the angle of incidence or the number of the colour."""
    data = cast(Colours, part.data)
    model = view.encoded(model)
    noisy = model + data.noise * random.standard_normal(model.shape)
    prefix, suffix = (f"{part.name}: ", f"_{part.name}") if part.name else ("", "")
    at = Axis(f"colour{suffix}", "colour", np.arange(1.0, len(data) + 1))
    if data.angle is not None:
        at = Axis(f"angle_deg{suffix}", "angle of incidence (degrees)", data.angle)
    return [
        Prediction(name + suffix, prefix + name, at, data.values[:, c], model[..., c], noisy[..., c])
        for c, name in enumerate(data.channels)
    ]


_OF = {Curve: _spectrum, ColourCurve: _colours, BrdfCurve: _samples}
"""Predictions of a part, by the kind of its curve."""
