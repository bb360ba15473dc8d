"""Colours of a film as a view of a least-squares problem.

The recorded linear channels are y = A f, with f the film's colour as the sensor has it, and
A = a B + Σ c_k G_k. B takes the sensor's colours to channels, and each mode G_k has a normal prior on its
coefficient. As with the scale and offset of a spectrum, the coefficients are solved in each evaluation
(variable projection).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.colour.spaces import Encoding
from pellicle.data.colours import Colours
from pellicle.fitting.coordinates import Array
from pellicle.fitting.film.view import error_of_plan
from pellicle.fitting.problem import Explained, Noise, NoiseGroup
from pellicle.fitting.reported_layer import linearised
from pellicle.forward_model.film_signal import build
from pellicle.forward_model.plan import Plan
from pellicle.optics.hoisting import compute_once
from pellicle.programs.cache import kept
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.scene.instrument import Drift


@dataclass(frozen=True)
class ColourForm:
    """The simulation of a spectrum for each colour by a plan without words, integrated by a sensor."""

    plan: Plan

    def simulate(self, scene: Scene, data: ColourData) -> Any:
        """Colours of the sensor at every angle, (colours · 3,)."""
        spectra = build(self.plan)(scene).reshape(len(data.values), -1)
        return (spectra @ data.sensor).reshape(-1)

    def with_plan(self, plan: Plan) -> ColourForm:
        """Return the form with another plan."""
        return replace(self, plan=plan)

    def explain(self, arrays: tuple[Scene, ColourData], values: Any, /) -> Explained:
        """The colours with the free parameters of their scene at `values`."""
        scene, data = arrays
        colours = compute_once(self.simulate(insert(scene, values), data)).reshape(-1, 3)
        recorded = record(colours, data)
        residual = jnp.concatenate([recorded.residual.reshape(-1), recorded.prior])
        return Explained(recorded.model, residual, recorded.determinant + jnp.sum(residual**2))


class Local(NamedTuple):
    """The model of colours around one point, for errors and reports."""

    colours: Array  # of the sensor, (colours, 3)
    slope: Array  # ∂ colours / ∂ parameter in its own unit, (colours, 3, parameters)
    model: Array  # linear channels as recorded, (colours, 3)
    residual: Array  # weighted, (colours, 3)
    coefficients: Array  # of the modes of the response
    exposure: Array
    layer: Array  # n and k of the layer at each wavelength
    layer_slope: Array  # their derivatives, (2, wavelengths, parameters)


@kept
def local(form: ColourForm, scene: Scene, data: ColourData, values: Any) -> Local:
    """Colours, their Jacobian, and the layer's index at `values` (parameters,)."""
    linear = linearised(form, scene, data, values)
    colours, slope = linear.signal.reshape(-1, 3), linear.slope.reshape(-1, 3, len(values))
    model, residual, coefficients, exposure, *_ = record(colours, data)
    residual /= jnp.sqrt(data.independent_fraction)
    recorded = model, residual, coefficients, exposure
    return Local(colours, slope, *recorded, linear.layer, linear.layer_slope)


@dataclass(frozen=True)
class Factor:
    """A coefficient of a camera's response: its value, and the standard deviation of its prior."""

    name: str
    value: float
    prior_sd: float
    pull: float
    not_negative: bool = False


@dataclass(frozen=True)
class ColoursView:
    """Colours of a problem, one at each angle of incidence.

    `scene` has anonymous free parameters and the wavelengths of the sensor, one after the other for each
    colour; `takes` are the positions of its parameters in the problem. `modes` names those of the response.
    """

    name: str  # empty where there is no other
    plan: Plan
    scene: Scene
    data: ColourData
    takes: tuple[int, ...]
    encoding: Encoding
    modes: tuple[str, ...]
    largest_index: float

    noise = Noise(given=True)
    channels = 3

    @property
    def form(self) -> ColourForm:
        return ColourForm(self.plan.static_key)

    @property
    def arrays(self) -> tuple[Scene, ColourData]:
        return self.scene, self.data

    @property
    def rows(self) -> int:
        """Number of colours."""
        return len(self.data.values)

    @property
    def points(self) -> int:
        """Data values: three of each colour."""
        return 3 * self.rows

    @property
    def independent(self) -> int:
        """Data values that are not clipped, one at least."""
        value, lowest, highest = (np.asarray(x) for x in (self.data.values, *self.data.clipped))
        return max(int(np.sum((value > lowest) & (value < highest))), 1)

    @property
    def noise_groups(self) -> tuple[NoiseGroup, ...]:
        """One group of all channels."""
        return (NoiseGroup(tuple(range(self.channels)), self.noise.known, self.independent),)

    @property
    def independent_fraction(self) -> Any:
        """Effective points per point (...): correlated errors count less."""
        return self.data.independent_fraction

    def local(self, values: Any) -> Local:
        """The model around `values` (its parameters,)."""
        return local(self.form, self.scene, self.data, values)

    def residuals(self, at: Local) -> np.ndarray:
        """Weighted residuals (colours, 3), of the model as the camera clips it."""
        return np.asarray(at.residual)

    def at_model(self, at: Any) -> float:
        """1: the noise of colours does not depend on the model."""
        return 1.0

    def by_local_noise(self, values: Any) -> ColoursView:
        """The view itself: its points are not neighbours along a spectrum."""
        return self

    def response(self, at: Local) -> np.ndarray:
        """The matrix (3, 3) from colours of the sensor to recorded linear channels."""
        camera = self.data.response
        modes = np.einsum("k,kij->ij", at.coefficients, camera.modes)
        return camera.known * camera.channels + at.exposure * modes

    def weighted(self, at: Local, change: np.ndarray) -> np.ndarray:
        """A change of the recorded linear channels (colours, 3, ...) as the residuals have it."""
        model, (lowest, highest) = np.asarray(at.model), self.data.clipped
        weight = np.asarray(self.data.weight) * ((model > lowest) & (model < highest))
        return np.einsum("pi,pij,pj...->pi...", weight, np.asarray(self.data.frame), change)

    def nuisances(self, at: Local) -> list[Factor]:
        """Exposure, white balance and the modes of a chart's matrix."""
        suffix, unit = f".{self.name}" if self.name else "", float(at.exposure)
        columns = (at.coefficients, self.data.response.mean, self.data.response.sd)
        rows = zip(self.modes, *(np.asarray(x).tolist() for x in columns), strict=True)
        # an unknown factor has next to no prior, and is in its own unit
        return [
            Factor(f"instrument.{name}{suffix}", *((unit * c, unit * s, 0.0) if mean else (c, s, c / s)))
            for name, c, mean, s in rows
        ]

    def jacobian(self, at: Local) -> np.ndarray:
        """Weighted ∂ model / ∂ parameter, then by each mode in units of its prior, (colours · 3, parameters
        and modes)."""
        steep = np.einsum("ij,pjk->pik", self.response(at), np.asarray(at.slope))
        own = self.data.response
        flat = np.einsum("kij,pj,k->pik", own.modes, at.colours, float(at.exposure) * np.asarray(own.sd))
        return self.weighted(at, np.concatenate([steep, flat], axis=2)).reshape(self.points, -1)

    def nuisance_freedom(self, at: Local) -> float:
        """Trace of the hat matrix of the modes: colours add little to a matrix that a chart gives."""
        design = self.jacobian(at)
        design = design[:, design.shape[1] - len(self.modes) :]
        fisher = design.T @ design
        return float(np.trace(np.linalg.solve(fisher + np.eye(len(self.modes)), fisher)))

    def correlation_length(self, residuals: np.ndarray) -> float:
        """1: colours at several angles have nothing in common but the film."""
        return 1.0

    def reweighted(self, factor: Any, fraction: float) -> ColoursView:
        """Weights times `factor` (a number, (channels,) or (rows, channels)), each point for `fraction` of
        one."""
        return replace(self, data=self.data._replace(weight=self.data.weight * factor)).counting(fraction)

    def counting(self, fraction: Any) -> ColoursView:
        """The view with each point counting for `fraction` (...) of an independent one."""
        return replace(self, data=self.data._replace(independent_fraction=np.asarray(fraction, float)[()]))

    def thinned(self) -> ColoursView:
        """The view as it is: the integral needs all wavelengths."""
        return self

    def off_tolerance(self, values: np.ndarray) -> float:
        """Error of the view's plan at `values`, in the unit of its signal."""
        return error_of_plan(self.plan, self.scene, values)

    def encoded(self, linear: Any) -> np.ndarray:
        """Linear channels (..., 3) in the space of the data."""
        linear = np.asarray(linear)
        return self.encoding.encode(linear, self.encoding.roots(linear))

    def rms(self, at: Local) -> float:
        """rms of the residuals in the space of the data."""
        return float(np.sqrt(np.mean((self.encoded(self.data.values) - self.encoded(at.model)) ** 2)))


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

    `values` (colours, 3); `frame` (colours, 3, 3): residual = weight · (frame @ (values − model)); `clipped`
    are the ends, a number and (colours, 3), at which the camera clips. `sensor` (bands, 3) makes a colour of
    a spectrum.
    """

    values: Array
    frame: Array
    weight: Array
    clipped: tuple[Array | np.floating, Array]
    sensor: Array
    response: Response
    independent_fraction: Array | np.floating = np.float64(1.0)


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
    modes: dict[str, np.ndarray] = {}
    if data.white_balance == "free":
        rows = zip(data.channels, np.eye(3), strict=True)
        modes = {f"white_balance_{letter}": row[:, None] * channels for letter, row in rows}
    elif isinstance(scale, Drift):
        modes = {"scale": channels}
    mean, sd = np.ones(len(modes)), np.full(len(modes), LOOSE)
    if data.camera is not None:
        values, vectors = np.linalg.eigh(np.asarray(data.camera.covariance))
        errors = [v.reshape(3, 3) * x**0.5 for x, v in zip(values, vectors.T, strict=True) if x > 0]
        modes |= {f"camera_{i}": error for i, error in enumerate(errors, start=1)}
        mean, sd = np.append(mean, np.zeros(len(errors))), np.append(sd, np.ones(len(errors)))
    known = 0.0 if isinstance(scale, Drift) or data.white_balance != "fixed" else float(scale)
    stacked = np.reshape(list(modes.values()), (-1, 3, 3))
    return Response(channels, np.float64(known), stacked, mean, sd), list(modes)


def record(colours: Any, data: ColourData) -> Recorded:
    """Colours (colours, 3) of the sensor as recorded, with the modes at their best."""
    response, weight = data.response, data.weight * jnp.sqrt(data.independent_fraction)
    exposed = colours @ response.channels.T
    # a channel that the camera clips says nothing of the exposure; where a dark one begins to, it is 0
    lowest, highest = data.clipped
    inside = jnp.where((exposed > lowest) & (data.values < highest), weight, 0.0)

    def seen(channels: Any) -> Any:
        """Linear channels, or differences of them, in standard deviations, without clipped ones."""
        return inside * jnp.einsum("pij,pj->pi", data.frame, channels)

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
    model = jnp.clip(model, lowest, highest)
    residual = weight * jnp.einsum("pij,pj->pi", data.frame, data.values - model)
    prior = (coefficients - response.mean) / response.sd
    return Recorded(model, residual, coefficients, exposure, prior, determinant)
