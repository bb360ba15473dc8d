"""Response of a camera to the colours of a film: exposure, white balance and the matrix of a chart.

The recorded linear channels are y = A f, with f the film's colour as the sensor has it, and
A = a B + Σ c_k G_k. B takes the sensor's colours to channels, and each mode G_k has a normal prior on its
coefficient. As with the scale and offset of a spectrum, the coefficients are solved in each evaluation
(variable projection).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.data.colours import Colours
from pellicle.fitting.coordinates import Array
from pellicle.scene.instrument import Drift

LOOSE = 10.0
"""Prior standard deviation of an unknown factor, in units of itself: next to no prior."""


class Response(NamedTuple):
    """Linear response of a camera: `known` times `channels` (3, 3), and `modes` (modes, 3, 3).

    `mean` and `sd` (modes,) are those of the modes' coefficients, in units of the exposure.
    """

    channels: Array
    known: Array | float
    modes: Array
    mean: Array
    sd: Array


class ColourData(NamedTuple):
    """Colours as a fit has them: linear channels, each with the matrix that turns differences into σ.

    `values` (colours, 3); `frame` (colours, 3, 3): residual = weight · (frame @ (values − model)); `limits`
    (colours, 3) is 1 where the film may be brighter than the value, −1 where it may be darker, else 0.
    `sensor` (bands, 3) makes a colour of a spectrum.
    """

    values: Array
    frame: Array
    weight: Array
    limits: Array
    sensor: Array
    response: Response
    independent_fraction: Array | np.floating


class Recorded(NamedTuple):
    """Colours as the camera records them: linear channels (colours, 3), weighted residuals (colours, 3), the
    coefficients of the modes (modes,), the exposure in which they are measured, and the deviance without the
    residuals: that of the modes' priors and of their determinant."""

    model: Array
    residual: Array
    coefficients: Array
    exposure: Array
    prior: Array
    determinant: Array


def camera_response(data: Colours, channels: np.ndarray, scale: float | Drift) -> tuple[Response, list[str]]:
    """The response of the camera that recorded `data`, and the names of its modes.

    `channels` (3, 3) takes the sensor's colours to linear channels; `scale` is the exposure.
    """
    rows = np.eye(3)
    modes: list[np.ndarray] = []
    names: list[str] = []
    if data.white_balance == "free":
        modes = [row[:, None] * channels for row in rows]
        names = [f"white_balance_{letter}" for letter in data.channels]
    elif isinstance(scale, Drift):
        modes, names = [channels], ["scale"]
    mean, sd = np.ones(len(modes)), np.full(len(modes), LOOSE)
    if data.camera is not None:
        values, vectors = np.linalg.eigh(np.asarray(data.camera.covariance))
        own = [v.reshape(3, 3) * x**0.5 for x, v in zip(values, vectors.T, strict=True) if x > 0]
        modes += own
        names += [f"camera_{i}" for i in range(1, len(own) + 1)]
        mean, sd = np.append(mean, np.zeros(len(own))), np.append(sd, np.ones(len(own)))
    known = 0.0
    if not isinstance(scale, Drift) and data.white_balance == "fixed":
        known = float(scale)
    stacked = np.stack(modes) if modes else np.zeros((0, 3, 3))
    return Response(channels, np.float64(known), stacked, mean, sd), names


def record(colours: Any, data: ColourData) -> Recorded:
    """Colours (colours, 3) of the sensor as recorded, with the modes at their best."""
    response, weight = data.response, data.weight * jnp.sqrt(data.independent_fraction)
    inside = jnp.where(data.limits == 0, weight, 0.0)

    def seen(channels: Any) -> Any:
        """Linear channels, or differences of them, in standard deviations, without those at a limit."""
        return inside * jnp.einsum("pij,pj->pi", data.frame, channels)

    exposed = colours @ response.channels.T
    along, measured = seen(exposed), seen(data.values)
    # the exposure by plain least squares: the unit of the coefficients, as a known exposure is
    plain = jnp.sum(along * measured) / (jnp.sum(along**2) + 1e-30)
    exposure = jnp.where(response.known > 0, response.known, plain)
    terms = exposure * jnp.einsum("kij,pj->kpi", response.modes, colours)
    model = response.known * exposed
    coefficients, determinant = response.mean, jnp.zeros(())
    if len(response.modes):
        design = jnp.stack([seen(term).reshape(-1) for term in terms], axis=1)
        matrix = design.T @ design + jnp.diag(1 / response.sd**2)
        target = design.T @ (measured - seen(model)).reshape(-1) + response.mean / response.sd**2
        coefficients = jnp.linalg.solve(matrix, target)
        determinant = jnp.linalg.slogdet(matrix)[1] + 2 * jnp.sum(jnp.log(response.sd))
        model = model + jnp.einsum("k,kpi->pi", coefficients, terms)
    missed = weight * jnp.einsum("pij,pj->pi", data.frame, data.values - model)
    allowed = jnp.where(data.limits > 0, jnp.maximum(missed, 0.0), jnp.minimum(missed, 0.0))
    residual = jnp.where(data.limits == 0, missed, allowed)
    prior = (coefficients - response.mean) / response.sd
    return Recorded(model, residual, coefficients, exposure, prior, determinant)
