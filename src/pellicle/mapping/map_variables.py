"""Variables of a map: what is stored of the fit of each pixel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pellicle.fitting.parameter import Parameter
from pellicle.mapping.pixels.results import CODES, NO_DATA, STATUSES, PixelFits

STATUS = "status"
ORDER = "order"
"""Name of the axis of the minima of a pixel, best first."""


@dataclass(frozen=True)
class Variable:
    """A variable of a map; `of` computes it from the fits of some pixels, with the axis of orders last.

    Values of pixels that are not fitted yet are `fill`.
    """

    name: str
    of: Callable[[PixelFits], np.ndarray]
    attributes: dict[str, Any]
    dtype: str = "float32"
    orders: bool = False
    fill: Any = field(default=np.nan)


def variable_name(parameter: str) -> str:
    """The name of a parameter as a variable: `film.thickness` is `film_thickness`."""
    return parameter.replace(".", "_")


def variables(parameters: Sequence[Parameter]) -> list[Variable]:
    """List the variables of a map of these free parameters, in the order of the fits' arrays."""
    found = [
        Variable(
            STATUS,
            lambda fits: fits.status,
            {
                "long_name": "status of the fit",
                "flag_values": list(range(len(STATUSES))),
                "flag_meanings": " ".join(STATUSES),
            },
            "uint8",
            fill=CODES[NO_DATA],
        )
    ]
    for i, parameter in enumerate(parameters):
        found += _of_parameter(i, parameter)
    one = {"units": "1"}
    return [
        *found,
        Variable(
            "rival_delta_chi2",
            lambda fits: _finite(fits.delta_chi2[:, 1]),
            {"long_name": "delta chi2 of the best other minimum"} | one,
        ),
        Variable(
            "order_delta_chi2",
            lambda fits: _finite(fits.delta_chi2),
            {"long_name": "delta chi2 of each minimum"} | one,
            orders=True,
        ),
        Variable("chi2_reduced", lambda fits: fits.chi2_reduced, {"long_name": "reduced chi2"} | one),
        Variable("rms", lambda fits: fits.rms, {"long_name": "root mean square of the residuals"}),
    ]


def _of_parameter(i: int, parameter: Parameter) -> list[Variable]:
    name, text = variable_name(parameter.name), parameter.name
    unit = {"units": {"degrees": "degree"}.get(parameter.unit, parameter.unit) or "1"}
    return [
        Variable(
            name, lambda fits: fits.values[:, i], {"long_name": text, "parameter": text} | unit, "float64"
        ),
        Variable(
            f"{name}_stderr",
            lambda fits: fits.stderr[:, i],
            {"long_name": f"standard error of {text}, of noise and model"} | unit,
        ),
        Variable(
            f"{name}_stderr_noise",
            lambda fits: fits.stderr_noise[:, i],
            {"long_name": f"standard error of {text}, of the noise alone"} | unit,
        ),
        Variable(
            f"rival_{name}",
            lambda fits: fits.minima[:, 1, i],
            {"long_name": f"{text} of the best other minimum"} | unit,
        ),
        Variable(
            f"order_{name}",
            lambda fits: fits.minima[:, :, i],
            {"long_name": f"{text} of each minimum, best first"} | unit,
            orders=True,
        ),
    ]


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.nan)
