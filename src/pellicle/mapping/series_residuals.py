"""Residuals of a series: what the fit of all times leaves of each spectrum, and the worst spectra."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.fitting.batch import polish
from pellicle.mapping.growth import TIME
from pellicle.mapping.series_spectra import Spectra

SHOWN, WORST, WAVELENGTH = "time_shown", "time_worst", "wavelength"
_MOST, _WORST = 400, 3
"""Times of the image at most, and spectra that are kept as the worst."""


_ABOUT = {"units": "1", "long_name": "data - fit"}


def of_trace(cube: Cube, light: np.ndarray, left: np.ndarray) -> dict[str, tuple[Any, ...]]:
    """Variables of the `light` of a trace and of what its fit has `left`, both (times, wavelengths)."""
    with np.errstate(invalid="ignore"):  # times without data
        rms = np.sqrt(np.nansum(left**2, axis=1) / np.isfinite(left).sum(1))
    return {
        WAVELENGTH: (WAVELENGTH, cube.wavelength, {"units": "nm"}),
        "light": ((TIME, WAVELENGTH), light, {"units": "1", "long_name": "light as measured"}),
        "residual": ((TIME, WAVELENGTH), left, _ABOUT),
        "residual_rms": (TIME, rms, _ABOUT | {"long_name": "root mean square of data - fit"}),
    }


def residuals(spectra: Spectra, time: np.ndarray, units: np.ndarray) -> dict[str, tuple[Any, ...]]:
    """Variables of the residuals of a series, as `xarray.Dataset.assign` takes them, with coordinates.

    `residual_rms` (times,), that of all points of a time; `residual` (times shown, wavelengths), data − fit
    at evenly spaced times; `worst_data` and `worst_fit` (worst times, wavelengths), the spectra of the
    largest rms. Of Ψ and Δ the residuals are the sizes of those of N, C, S, and there are no worst spectra.

    **Arguments:** `time` of the cube, and the parameters of the `spectra` in the `units` of the unit cube
    (times, parameters).
    """
    search, cube, used = spectra.model.search, spectra.cube, spectra.used
    step, single, worst = max(-(-len(time) // _MOST), 1), search.view.channels == 1, []
    rms, image = np.full(len(time), np.nan), np.full((len(time[::step]), cube.wavelength.size), np.nan)
    for own, data in spectra.blocks():
        which, at = used[own], np.clip(units[own], 0.0, 1.0)
        fit = polish.in_rows(polish.at_best, search.static, search.common, data, at).model
        known = data.weight > 0
        left = np.where(known, data.values - fit, np.nan).reshape(len(which), -1, search.view.channels)
        rms[which] = np.sqrt(np.nanmean(left**2, axis=(1, 2)))
        shown = which % step == 0
        size = left[shown, :, 0] if single else np.sqrt(np.mean(left[shown] ** 2, axis=2))
        image[which[shown] // step] = size
        if single:
            order = np.argsort(-rms[which])[:_WORST]
            rows = zip(which[order], np.where(known, data.values, np.nan)[order], fit[order], strict=True)
            worst = sorted([*worst, *rows], key=lambda row: -rms[row[0]])[:_WORST]
    found = {
        WAVELENGTH: (WAVELENGTH, cube.wavelength, {"units": "nm"}),
        SHOWN: (SHOWN, time[::step]),
        "residual": ((SHOWN, WAVELENGTH), image.astype("float32"), _ABOUT),
        "residual_rms": (TIME, rms, _ABOUT | {"long_name": "root mean square of data - fit"}),
    }
    if worst:
        at, data, fit = (np.array(column) for column in zip(*worst, strict=True))
        found[WORST] = WORST, time[at]
        found["worst_data"] = (WORST, WAVELENGTH), data, {"units": "1"}
        found["worst_fit"] = (WORST, WAVELENGTH), fit, {"units": "1"}
    return found
