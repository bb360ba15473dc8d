"""Minima of pixels by the search of `pellicle.fit`, one pixel after the other, and its fits of them."""

from typing import NamedTuple

import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.fitting.progress import quiet
from pellicle.fitting.result import Fit
from pellicle.fitting.spectra.fit import fitted, measurements
from pellicle.fitting.spectra.problem import make
from pellicle.fitting.spectra.search import search
from pellicle.mapping.pixel_minima import ORDERS, PixelData, PixelMinima
from pellicle.mapping.pixels import PixelModel, spectrum


class Searched(NamedTuple):
    data: PixelData
    minima: PixelMinima
    fits: list[Fit]


def searched(model: PixelModel, cube: Cube) -> Searched:
    """Data, minima and fits of all pixels of a cube, whose points may be missing here and there."""
    block = cube.pixels(tuple(slice(None) for _ in cube.shape))
    pixels = [{name: values[i] for name, values in block.items()} for i in range(len(block["values"]))]
    with jax.enable_x64(True):
        rows = [_one(model, cube, pixel) for pixel in pixels]
    minima = {name: np.array([row[0][name] for row in rows]) for name in PixelMinima._fields}
    minima["thickness"] = minima["thickness"][0]
    data = {name: [row[1][name] for row in rows] for name in PixelData._fields}
    arrays = {name: None if column[0] is None else np.array(column) for name, column in data.items()}
    return Searched(PixelData(**arrays), PixelMinima(**minima), [row[2] for row in rows])


def _one(model, cube, pixel):
    own = spectrum(cube, pixel)
    fit, _ = fitted(own, model.scene, 0.0, quiet)
    problem = make(*measurements(own, model.scene))
    found, [view], [whole] = search(problem, quiet), problem.views, model.problem.views
    known, channels, fraction = np.isfinite(pixel["values"]), view.channels, view.independent_fraction

    def points(column):
        out = np.zeros((whole.rows, channels))
        out[known] = np.asarray(column)[: view.points].reshape(-1, channels)
        return out.ravel()

    frame = None
    if view.data.frame is not None:
        frame = np.zeros((whole.rows, channels, channels))
        frame[known] = view.data.frame[: view.rows]
    count = min(ORDERS, len(found.units))
    values = np.asarray(problem.values(found.units))[:count]
    local = [view.local(each) for each in values]

    def orders(column, fill):
        rest = np.full((ORDERS - count, *np.shape(column)[1:]), fill)
        return np.concatenate([np.asarray(column)[:count], rest])

    minima = {
        "values": orders(values, np.nan),
        "units": orders(found.units, np.nan),
        "deviance": orders(found.deviance, np.inf),
        "misfit": orders([fraction * np.sum(view.residuals(at) ** 2) for at in local], np.inf),
        "converged": orders(found.converged, False),
        "model": points(local[0].model),
        "profile": found.scan.deviance.sum(-1).min(axis=0),
        "thickness": found.scan.thickness,
    }
    data = {
        "values": points(view.data.values),
        "weight": points(view.data.weight),
        "level": float(view.data.level),
        "frame": frame,
    }
    return minima, data, fit
