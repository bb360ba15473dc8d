"""A least-squares problem: parameters with bounds and priors, and the data that they explain.

Spectra (`fitting.film.problem`) and BRDF samples (`fitting.brdf.problem`) are two kinds of `View`;
whatever comes after the search takes a `Problem` and depends on neither.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import jax.numpy as jnp
import numpy as np

from pellicle.fitting.coordinates import Array, Box, Coordinates
from pellicle.fitting.parameter import Parameter
from pellicle.forward_model.plan import Plan


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


class Blocks(NamedTuple):
    """Pieces of one shape of a view's arrays: their number, traced, and the function that returns one."""

    count: Any
    at: Callable[[Any], Any]


@runtime_checkable
class Form(Hashable, Protocol):
    """The static part of a view: its `repr` says all that a compiled program depends on."""

    def explain(self, arrays: Any, values: Any, /) -> Explained:
        """The view with parameters at `values` (its parameters,)."""
        ...


@runtime_checkable
class Blocked(Hashable, Protocol):
    """A form whose points are independent, and evaluated in blocks: one program serves few and many."""

    def blocks(self, arrays: Any, /) -> Blocks: ...


@runtime_checkable
class Elementary(Hashable, Protocol):
    """A form that NumPy evaluates, where its plan allows it: nothing is then compiled."""

    def numpy_share(self, arrays: Any, /) -> float:
        """Time of one candidate by NumPy, as a share of the compilation of a program of slopes; infinite
        where NumPy cannot."""
        ...

    def explained(self, arrays: Any, values: np.ndarray, /) -> Explained | None:
        """The view at candidates `values` (candidates, its parameters), with an axis of these in front; None
        where NumPy cannot."""
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

    def by_local_noise(self, values: Any) -> View:
        """The view with weights by the noise of neighbouring points at `values` (its parameters,), where σ is
        not given and differs."""
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


Static: TypeAlias = tuple[Coordinates, tuple[tuple[Form, tuple[int, ...]], ...]]
"""Coordinates of a problem, and the form and the parameters of each view: see `Problem.static`."""


class Member(NamedTuple):
    """One of the problems that share a compiled program: its static part and its number of parameters."""

    static: Static
    size: int


class Problem(NamedTuple):
    """Parameters of one sample and the views that they explain together.

    A `family` are problems with the same arrays, this one among them, which one program solves.
    """

    views: tuple[Any, ...]
    parameters: tuple[Parameter, ...]
    box: Box
    coordinates: Coordinates = Coordinates()
    family: tuple[Member, ...] = ()

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
        return self._deepest(range(len(self.parameters)))

    def depth_of(self, view: View) -> int | None:
        """Position of the thickness with the widest bounds that a view depends on; None without any."""
        return self._deepest(view.takes)

    def _deepest(self, positions: Sequence[int]) -> int | None:
        every = ((i, self.parameters[i]) for i in positions)
        spans = {i: p.upper - p.lower for i, p in every if p.key == "thickness"}
        return max(spans, key=lambda i: spans[i]) if spans else None

    @property
    def static(self) -> Static:
        """Static part of a compiled program of all views."""
        return self.coordinates, tuple((view.form, view.takes) for view in self.views)

    @property
    def member(self) -> Member:
        return Member(self.static, len(self.parameters))

    @property
    def solved_together(self) -> tuple[Member, ...]:
        """The family, or the problem alone where it has been changed since."""
        return self.family if self.member in self.family else (self.member,)

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
