"""What the posterior says that each point of the data should have been."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import jax
import numpy as np

from pellicle.fitting.result import Part
from pellicle.fitting.spectra.evaluation import curves
from pellicle.fitting.spectra.parts import psi_delta
from pellicle.fitting.spectra.problem import Problem, View

DRAWS = 256
"""Curves behind a band: 2.5 % of them are six."""
_SIGNALS = {"R": "reflectance", "T": "transmittance"}


class Axis(NamedTuple):
    """What data are drawn against: its name in files, its label in figures, and its values (points,)."""

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
    """Of each spectrum one, or Ψ and Δ, from draws (steps, walkers, parameters) in the unit cube."""
    random = np.random.default_rng(seed)
    drawn = chosen(units, random)
    with jax.enable_x64(True):
        each = zip(problem.views, parts, strict=True)
        return tuple(found for view, part in each for found in _of(view, part, drawn, random))


def _of(view: View, part: Part, drawn: np.ndarray, random: np.random.Generator) -> Iterator[Prediction]:
    model = np.asarray(curves(*view.program, drawn[:, list(view.takes)]).model)[:, : view.points]
    sigma = 1 / np.asarray(view.data.weight)[: view.points]
    noisy = model + sigma * random.standard_normal(model.shape)
    curve, (prefix, suffix) = part.curve, (f"{part.name}: ", f"_{part.name}") if part.name else ("", "")
    axis = Axis(f"wavelength_nm{suffix}", "wavelength (nm)", curve.wavelength)
    if curve.delta_data is None:
        signal = part.spectrum.signal
        yield Prediction(signal + suffix, prefix + _SIGNALS[signal], axis, curve.data, model, noisy)
        return
    angles = zip(*(psi_delta(view.in_columns(x)) for x in (model, noisy)), strict=True)
    names, data = (("psi", "Ψ"), ("delta", "Δ")), (curve.data, curve.delta_data)
    for (name, sign), measured, drawn_angles in zip(names, data, angles, strict=True):
        yield Prediction(f"{name}{suffix}", f"{prefix}{sign} (degrees)", axis, measured, *drawn_angles)
