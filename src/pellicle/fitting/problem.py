"""A least-squares problem: parameters, bounds and priors, coordinates of a search, and the data to explain.

Spectra (`fitting.film.problem`) and BRDF samples (`fitting.brdf.problem`) are two kinds of `View`;
whatever comes after the search takes a `Problem` and depends on neither.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.parameter import Parameter
from pellicle.forward_model.plan import Plan
from pellicle.optics.pair import namespace
from pellicle.scene.priors import LogUniform, Prior

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, how much is done and how much there is."""


def quiet(stage: str, done: int, total: int) -> None:
    """A no-op progress callback."""


Array: TypeAlias = jax.Array | np.ndarray

LEAST_SQUARE = 1e-6
"""Least y² in the disc: a fiftieth of a degree off the plane, where y² → y still has a slope."""


class Box(NamedTuple):
    """Bounds of the coordinates, and priors on the parameters in their own units, each (parameters,).

    Normal and half-normal priors have a mean and a weight; `logarithmic` is 1 for a log-uniform prior, which
    posteriors use and fits do not. `reach` is the largest deviation of a tilt in degrees.
    """

    lower: Array
    upper: Array
    prior_mean: Array
    prior_weight: Array  # 1/sd, 0 for none
    logarithmic: Array
    reach: Array | np.floating = np.float64(0.0)

    def prior_rows(self, values: Any) -> Any:
        """Weighted distances of the values from the means of their priors, (parameters,)."""
        return (values - self.prior_mean) * self.prior_weight

    def log_prior(self, values: Any) -> Any:
        """ln of the priors at values of the parameters, up to a constant."""
        logarithm = jnp.log(jnp.where(self.logarithmic > 0, values, 1.0))
        return -0.5 * jnp.sum(self.prior_rows(values) ** 2) - jnp.sum(self.logarithmic * logarithm)


def box(lower: np.ndarray, upper: np.ndarray, priors: Sequence[Prior | None], reach: float = 0.0) -> Box:
    """The box between bounds (parameters,), with the prior of each parameter."""
    rows = [prior.mean_and_weight if prior else (0.0, 0.0) for prior in priors]
    mean, weight = np.reshape(rows, (-1, 2)).T
    logarithmic = np.array([float(isinstance(prior, LogUniform)) for prior in priors])
    return Box(lower, upper, mean, weight, logarithmic, np.float64(reach))


class Coordinates(NamedTuple):
    """Map from the unit cube to values: static and hashable, a part of a program's key."""

    log: tuple[bool, ...] = ()  # coordinates that are logarithms, none where empty
    tilt: tuple[int, int] | None = None  # positions of deviation and azimuth where they are x and y of a disc
    folded: bool = False  # y² in the place of y

    def values(self, box: Box, unit: Any) -> Any:
        """The parameters in their own units at `unit` (..., parameters)."""
        x = box.lower + unit * (box.upper - box.lower)
        xp = namespace(x)
        if any(self.log):
            log = np.array(self.log)
            x = xp.where(log, xp.exp(xp.where(log, x, 0.0)), x)
        if self.tilt is None:
            return x
        a, b = self.tilt
        y = xp.sqrt(x[..., b]) if self.folded else x[..., b]
        # the square onto the disc, smoothly and edge to edge: see `log_area`
        u, v = x[..., a] * xp.sqrt(1 - 0.5 * y**2), y * xp.sqrt(1 - 0.5 * x[..., a] ** 2)
        # its azimuth has a slope everywhere but at the centre
        u = xp.where(u * u + v * v < 1e-20, 1e-10, u)
        radius, azimuth = box.reach * xp.sqrt(u * u + v * v), xp.rad2deg(xp.arctan2(v, u))
        if xp is jnp:
            return x.at[..., a].set(radius).at[..., b].set(azimuth)
        x[..., a], x[..., b] = radius, azimuth
        return x

    def slope(self, box: Box, unit: np.ndarray) -> np.ndarray:
        """∂ values / ∂ unit at one point, (parameters, parameters)."""
        if not any(self.log) and self.tilt is None:
            return np.diag(box.upper - box.lower)
        return np.asarray(_slope(self, box, unit))

    def log_area(self, box: Box, unit: Any) -> Any:
        """ln of the area of the disc of tilts that a step in the unit cube covers, up to a constant; not
        folded."""
        if self.tilt is None:
            return 0.0
        x, y = (box.lower[at] + unit[at] * (box.upper[at] - box.lower[at]) for at in self.tilt)
        sides = jnp.sqrt((1 - 0.5 * y**2) * (1 - 0.5 * x**2))
        return jnp.log(sides - (0.5 * x * y) ** 2 / sides)


@partial(jax.jit, static_argnums=0)
def _slope(coordinates: Coordinates, box: Box, unit: Any) -> Any:
    return jax.jacfwd(lambda unit: coordinates.values(box, unit))(unit)


class Noise(NamedTuple):
    """Source of the weights: `given` is an absolute σ; `drifting` is the error of a model whose lamp drifts.

    `correlated`: the covariance counts correlated residuals as fewer points even where σ is given. `uneven`:
    σ is not given and may differ from point to point, so the covariance takes each point's from its residual.
    """

    given: bool = True
    drifting: bool = False
    correlated: bool = False
    uneven: bool = False

    @property
    def known(self) -> bool:
        """True where the residuals do not set the weights."""
        return self.given or self.drifting


class NoiseGroup(NamedTuple):
    """Channels of a view that share one noise, whether it is known, and their independent data values."""

    channels: tuple[int, ...]
    known: bool
    independent: int


class Explained(NamedTuple):
    """One view at one set of values; traced."""

    model: Array  # as measured, with nuisances at their best
    residual: Array  # weighted, with a row for each prior of a nuisance
    deviance: Array  # −2 ln of the marginal likelihood, up to a constant


@runtime_checkable
class Form(Hashable, Protocol):
    """The static part of a view: its `repr` says all that a compiled program depends on."""

    def explain(self, arrays: Any, values: Any, /) -> Explained:
        """The view with parameters at `values` (its parameters,)."""
        ...


@runtime_checkable
class Nuisance(Protocol):
    """A linear coefficient that is solved in each evaluation, such as a scale or an offset."""

    @property
    def name(self) -> str: ...
    @property
    def value(self) -> Any: ...
    @property
    def prior_sd(self) -> Any: ...
    @property
    def pull(self) -> Any:
        """Distance from the mean of its prior, in standard deviations of that."""
        ...

    @property
    def not_negative(self) -> bool: ...


@runtime_checkable
class View(Protocol):
    """One set of data of a problem: the model of it, its weights, and which parameters it depends on.

    `local` evaluates the model around one point; what it returns is the argument of the methods below it. A
    view of many data sets that one scene explains has leading axes (...) in its data and what they return.
    """

    @property
    def name(self) -> str:
        """Empty where there is no other view."""
        ...

    @property
    def takes(self) -> tuple[int, ...]:
        """Positions of its parameters in the problem."""
        ...

    @property
    def noise(self) -> Noise: ...
    @property
    def plan(self) -> Plan: ...
    @property
    def form(self) -> Form: ...
    @property
    def arrays(self) -> Any:
        """Numbers of the view, as a pytree: the arguments of its program."""
        ...

    @property
    def rows(self) -> int:
        """Measured points, without padding; each has one or several data values."""
        ...

    @property
    def channels(self) -> int:
        """Data values of each point."""
        ...

    @property
    def independent(self) -> int:
        """Independent data values."""
        ...

    @property
    def noise_groups(self) -> tuple[NoiseGroup, ...]:
        """All channels, those of one noise together."""
        ...

    @property
    def independent_fraction(self) -> Any:
        """Effective points per point: correlated errors count less."""
        ...

    def local(self, values: Any) -> Any:
        """The model and its derivatives at `values` (its parameters,)."""
        ...

    def residuals(self, at: Any) -> np.ndarray:
        """Weighted residuals (rows, channels)."""
        ...

    def at_model(self, at: Any) -> Any:
        """Weights by the noise of the model's values over those by the measured ones (rows, channels).

        1 where the noise does not depend on the signal.
        """
        ...

    def by_local_noise(self, at: Any) -> View:
        """The view with weights by the noise of neighbouring points, where σ is not given and differs."""
        ...

    def jacobian(self, at: Any) -> np.ndarray:
        """Weighted ∂ model / ∂ parameter in its own unit, then by each nuisance in units of its prior:
        (rows · channels, its parameters and nuisances)."""
        ...

    def nuisances(self, at: Any) -> Sequence[Nuisance]: ...

    def nuisance_freedom(self, at: Any) -> float:
        """Degrees of freedom that the nuisances take from the data."""
        ...

    def correlation_length(self, residuals: np.ndarray) -> float:
        """Number of neighbouring points that count as one."""
        ...

    def reweighted(self, factor: Any, fraction: Any) -> View:
        """The view with its weights times `factor` (broadcast to (..., rows, channels)), each point counting
        for `fraction` (...) of an independent one."""
        ...

    def counting(self, fraction: Any) -> View:
        """The view with each point counting for `fraction` of an independent one, and no less."""
        ...

    def thinned(self) -> View:
        """The view with fewer points, of the same total weight, where it has more than a scan needs."""
        ...

    def off_tolerance(self, values: np.ndarray) -> float:
        """Error of the view's plan at `values`, in the unit of its signal; 0 for an exact plan."""
        ...


class UsualView:
    """What views do unless they say otherwise: one noise for all channels, no neighbours along a spectrum."""

    @property
    def independent_fraction(self: Any) -> Any:
        """Effective points per point (...): correlated errors count less."""
        return self.data.independent_fraction

    @property
    def noise_groups(self: Any) -> tuple[NoiseGroup, ...]:
        """One group of all channels."""
        return (NoiseGroup(tuple(range(self.channels)), self.noise.known, self.independent),)

    def at_model(self, at: Any) -> Any:
        """1: the noise does not depend on the model."""
        return 1.0

    def by_local_noise(self, at: Any) -> Any:
        """The view itself: its points are not neighbours along a spectrum."""
        return self

    def counting(self: Any, fraction: Any) -> Any:
        """The view with each point counting for `fraction` (...) of an independent one."""
        return replace(self, data=self.data._replace(independent_fraction=np.asarray(fraction, float)[()]))

    def thinned(self) -> Any:
        """The view as it is: a scan needs all of its points."""
        return self


class Problem(NamedTuple):
    """Parameters of one sample and the views that they explain together."""

    views: tuple[Any, ...]
    parameters: tuple[Parameter, ...]
    box: Box
    coordinates: Coordinates = Coordinates()

    def values(self, units: Any) -> Any:
        """Parameters in their own units at `units` (..., parameters) of the unit cube."""
        return self.coordinates.values(self.box, units)

    def values_near(self, units: np.ndarray, best: np.ndarray) -> np.ndarray:
        """Parameters in their own units at `units` (..., parameters), an azimuth within half a turn of the
        one at `best` (parameters,)."""
        values = np.array(self.values(jnp.asarray(units)))
        if self.coordinates.tilt is not None:
            at = self.coordinates.tilt[1]
            values[..., at] = best[at] + (values[..., at] - best[at] + 180) % 360 - 180
        return values

    def seen_by(self, view: View, values: Any) -> Any:
        """The values (..., parameters) that a view depends on."""
        return values[..., list(view.takes)]

    @property
    def thickness_axis(self) -> int | None:
        """Position of the thickness that a search scans: the one with the widest bounds; None without any."""
        spans = {i: p.upper - p.lower for i, p in enumerate(self.parameters) if p.key == "thickness"}
        return max(spans, key=lambda i: spans[i]) if spans else None

    @property
    def static(self) -> tuple[Coordinates, tuple[tuple[Form, tuple[int, ...]], ...]]:
        """Static part of a compiled program of all views."""
        return self.coordinates, tuple((view.form, view.takes) for view in self.views)

    @property
    def arrays(self) -> tuple[Any, ...]:
        """The numbers of all views."""
        return tuple(view.arrays for view in self.views)

    def thinned(self) -> Problem:
        """The problem with as many points as a scan needs."""
        return self._replace(views=tuple(view.thinned() for view in self.views))

    def affine(self) -> Problem:
        """Problem in coordinates that go evenly between the parameters' own bounds; a tilt stays a
        disc, half a one where its sign is not seen."""
        lower, upper = (np.array([getattr(p, side) for p in self.parameters]) for side in ("lower", "upper"))
        tilt, folded = self.coordinates.tilt, self.coordinates.folded
        if tilt is not None:
            lower[list(tilt)], upper[list(tilt)] = (-1.0, 0.0 if folded else -1.0), 1.0
        box = self.box._replace(lower=lower, upper=upper)
        return self._replace(box=box, coordinates=Coordinates(tilt=tilt))

    def in_own_units(self, values: np.ndarray) -> Problem:
        """The affine problem with deviation and azimuth in the place of a disc.

        A free azimuth goes half a turn to either side of its value; from 0 to 180 degrees where samples in
        one plane do not see its sign.
        """
        own, tilt = self.affine(), self.coordinates.tilt
        if tilt is None:
            return own
        lower, upper = own.box.lower.copy(), own.box.upper.copy()
        (deviation, azimuth), turn = tilt, np.array([-180.0, 180.0])
        lower[deviation], upper[deviation] = 0.0, self.box.reach
        ends = np.array([0.0, 180.0]) if self.coordinates.folded else values[azimuth] + turn
        lower[azimuth], upper[azimuth] = ends
        return own._replace(box=own.box._replace(lower=lower, upper=upper), coordinates=Coordinates())

    def in_affine(self, unit: np.ndarray) -> np.ndarray:
        """A point (parameters,) of this problem's unit cube in that of `affine`."""
        own, numbers = self.affine(), np.array(self.values(unit))
        for at in self.coordinates.tilt or ():
            numbers[at] = self.box.lower[at] + unit[at] * (self.box.upper[at] - self.box.lower[at])
        if self.coordinates.folded and self.coordinates.tilt is not None:
            numbers[self.coordinates.tilt[1]] **= 0.5
        return np.clip((numbers - own.box.lower) / (own.box.upper - own.box.lower), 0.0, 1.0)
