"""Abstract kind of signal: the interface of all kinds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pellicle.errors import UsageError
from pellicle.signals.limits import Where

Place = Callable[[str], Where]
"""The place of a point for a message about a column, as `Spectrum.place` returns it."""
_SIGMAS = {"values": "sigma", "delta": "delta_sigma", "depolarisation": "depolarisation_sigma"}
_CURVES = {"values": "", "delta": "delta_", "depolarisation": "depolarisation_"}


@runtime_checkable
class Arrays(Protocol):
    """Arrays of a spectrum, (points,) or (points, columns): see `pellicle.Spectrum`."""

    @property
    def values(self) -> np.ndarray: ...
    @property
    def sigma(self) -> np.ndarray | None: ...
    @property
    def delta(self) -> np.ndarray | None: ...
    @property
    def delta_sigma(self) -> np.ndarray | None: ...
    @property
    def depolarisation(self) -> np.ndarray | None: ...
    @property
    def depolarisation_sigma(self) -> np.ndarray | None: ...
    @property
    def calibrated(self) -> bool: ...
    def __len__(self) -> int: ...


class Cell(NamedTuple):
    """Panel of a quantity in a grid of panels.

    It has a `row` and a `column`, the `label` of its axis without unit, and at least the range `smallest`;
    `residual` names the line of its residuals.
    """

    row: int
    column: int
    label: str
    residual: str
    smallest: float


class Quantity(NamedTuple):
    """One measured quantity: a column of files, a curve of figures.

    `name` is that in files, `label` that of an axis without its unit, `unit` "" or "degrees", `array` the
    array of a spectrum that contains it ("values", "delta" or "depolarisation"), and `column` its column
    there (None for arrays of one column). `cell` is its panel, where figures have a grid of them.
    """

    name: str
    label: str
    unit: str = ""
    array: str = "values"
    column: int | None = None
    cell: Cell | None = None

    @property
    def axis(self) -> str:
        """Label of an axis: `Ψ (degrees)`."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    @property
    def header(self) -> str:
        """Name of a column of a file: `psi_deg`."""
        return f"{self.name}_deg" if self.unit else self.name

    @property
    def symbol(self) -> str:
        """Short name in figures: `Ψ`, `m12`, `R`."""
        return self.label if self.unit else self.name

    @property
    def wraps(self) -> bool:
        """True for an angle that goes on at 0 behind 360 degrees."""
        return self.array == "delta"

    def measured(self, data: Any) -> np.ndarray:
        """Return the values of a spectrum, (points,)."""
        return self._column(getattr(data, self.array))

    def error(self, data: Any) -> np.ndarray | None:
        """Return the stated standard deviations of a spectrum, (points,), or None."""
        sigma = getattr(data, _SIGMAS[self.array])
        return None if sigma is None else self._column(sigma)

    def curve(self, curve: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return data, model and residual of a fitted curve (`fitting.curves.Curve`), each (points,)."""
        names = (f"{_CURVES[self.array]}{what}" for what in ("data", "model", "residual"))
        data, model, residual = (self._column(getattr(curve, name)) for name in names)
        return data, model, residual

    def _column(self, array: np.ndarray) -> np.ndarray:
        return array if self.column is None else array[..., self.column]


class Channels(NamedTuple):
    """Values of a signal as a fit compares them, (points,) or (points, channels), and their σ, (points,) or
    the shape of the values. With a `frame` (points, channels, channels) they are components in it."""

    values: np.ndarray
    sigma: np.ndarray
    frame: np.ndarray | None = None


class ChannelGroup(NamedTuple):
    """Channels of one noise, how many of them are independent, and whether their noise was measured apart
    (None: as that of the signal)."""

    channels: tuple[int, ...]
    independent: int
    known: bool | None = None


class Offset(NamedTuple):
    """A systematic error of an instrument: its size, and the change of the columns of the signal by it,
    (..., points, columns)."""

    name: str
    size: float
    unit: str
    change: np.ndarray
    positive: bool = False


class Residuals(NamedTuple):
    """Residuals (points, channels) of one noise, in units of σ where that is `known`."""

    rows: np.ndarray
    known: bool
    independent: int


@dataclass(frozen=True)
class Signal(ABC):
    """A kind of signal; frozen and hashable, so that compiled programs may depend on it."""

    word: ClassVar[str]
    """The word of recipes, flags and files."""
    title: ClassVar[str]
    """Its name in summaries."""
    noun: ClassVar[str]
    """Its name in sentences."""
    simulated: ClassVar[str]
    """Quantity of the simulated light: "R", "T" or "Stokes"."""
    has_scale: ClassVar[bool] = False
    """True where the instrument's scale and offset apply."""
    of_counts: ClassVar[bool] = False
    has_reference: ClassVar[bool] = False
    """True for the change against a reference, which the scene describes too."""
    degrees: ClassVar[bool] = False
    """True where differences and residuals are degrees of Ψ on spheres of N, C, S."""
    names: ClassVar[tuple[str, ...]] = ()
    """Names of a column of its own, in lower case."""
    ordinate: ClassVar[str]
    """Label of an axis that all quantities share."""
    explored: ClassVar[bool] = True
    """True where the explorer draws it."""
    keywords: ClassVar[frozenset[str]] = frozenset()
    """Arguments of `pellicle.Spectrum` that go with this kind, beside those of any."""
    required: ClassVar[frozenset[str]] = frozenset()
    """Those of them that it needs."""
    named: ClassVar[str] = ""
    """The argument of them that names the `parts`."""
    every: ClassVar[tuple[str, ...]] = ()
    """Parts that it may have, in the order of the simulated light."""
    expected: ClassVar[str] = ""
    """Description of the allowed names of a list of them, for a message."""
    parts: tuple[str, ...] = ()
    """Names of the columns of `values`; empty for one column."""
    depolarisation: bool = False
    """True where 1 − N² − C² − S² was measured beside N, C and S."""
    transmission: bool = False
    """True for Ψ and Δ of transmitted light."""
    folded: bool = False
    """True where Δ is known in 0 to 180 degrees only."""

    def __post_init__(self) -> None:
        for name in self.parts:
            if name not in self.every:
                raise UsageError(f"`elements` {self.expected}, not {name!r}")
        if len(set(self.parts)) < len(self.parts):
            raise UsageError(f"`elements` are repeated: {', '.join(self.parts)}")

    @property
    def positions(self) -> list[int]:
        """Places of the `parts` among those of the simulated light."""
        return [self.every.index(name) for name in self.parts]

    @property
    def ellipsometric(self) -> bool:
        """True for signals that compare polarisations."""
        return self.simulated == "Stokes"

    @property
    def transmitted(self) -> bool:
        """True for signals of transmitted light."""
        return self.transmission or self.simulated == "T"

    @property
    def grid(self) -> tuple[tuple[str, ...], ...]:
        """Titles of the panels of a figure, row by row; empty where they stand one below the other."""
        return ()

    @property
    def words(self) -> dict[str, tuple[str, ...]]:
        """Arguments of `pellicle.Spectrum` that name this kind beside its word."""
        return {self.named: self.parts} if self.named else {}

    @property
    def error_unit(self) -> str:
        """Unit in which an error of the simulated light is stated: `of R`."""
        return f"of {self.word}"

    @property
    def waves(self) -> Any:
        """Traced functions of signals: a module that is imported when it is needed, since it imports JAX."""
        from pellicle.signals import waves

        return waves

    @property
    @abstractmethod
    def quantities(self) -> tuple[Quantity, ...]:
        """The measured quantities, in the order of files."""

    @property
    def share(self) -> Quantity | None:
        """The quantity that is the depolarisation; None where that was not measured."""
        return next((q for q in self.quantities if q.array == "depolarisation"), None)

    # a spectrum

    @classmethod
    def of(cls, data: Any) -> Signal:
        """Return the kind of a spectrum, by its keywords."""
        return cls(tuple(getattr(data, cls.named))) if cls.named else cls()

    @abstractmethod
    def check(self, data: Arrays, place: Place, remedy: str) -> None:
        """Refuse values that no sample has. Raises DataError."""

    def arrays(self, columns: Float[np.ndarray, "points columns"]) -> dict[str, np.ndarray]:
        """Return the arrays of a spectrum, of columns in the order of `quantities`."""
        result: dict[str, Any] = {}
        for quantity, column in zip(self.quantities, columns.T, strict=True):
            if quantity.column is None:
                result[quantity.array] = column
            else:
                result.setdefault(quantity.array, []).append(column)
        return {name: np.stack(x, axis=1) if isinstance(x, list) else x for name, x in result.items()}

    def errors(self, values: np.ndarray, noise: float) -> dict[str, np.ndarray]:
        """Return the standard deviations of a spectrum for one `noise` of all values."""
        return {"sigma": np.full(values.shape, float(noise))}

    @property
    def independent(self) -> int:
        """Independent numbers of one point."""
        return max(len(self.parts), 1)

    def coordinates(self, data: Arrays) -> Float[np.ndarray, "points channels"]:
        """Return the values as repeated sweeps of them are averaged."""
        return data.values.reshape(len(data), -1)

    def averaged(self, coordinates: Float[np.ndarray, "points channels"]) -> dict[str, np.ndarray]:
        """Return the arrays of a spectrum, of the mean of `coordinates`."""
        return {"values": coordinates if self.parts else coordinates[:, 0]}

    # simulated light

    def isotropic(self, rows: Sequence[Any]) -> Sequence[Any]:
        """Return the rows of the signal, of N, C and S, and of m22 and m44 of a cone of light (traced)."""
        raise NotImplementedError

    def of_jones(self, jones: Any) -> list[Any]:
        """Return sums of intensities, of the Jones matrix of layers that mix s and p (traced)."""
        raise NotImplementedError

    def of_mueller(self, matrix: Sequence[Sequence[Any]]) -> list[Any]:
        """Return the sums of `of_jones`, of a Mueller matrix (traced)."""
        raise NotImplementedError

    @abstractmethod
    def of_sums(self, sums: Sequence[Any]) -> Sequence[Any]:
        """Return the rows of the signal, of averaged sums of intensities (traced)."""

    def of_power(self, power: Any) -> Any:
        """Return the signal of the simulated R or T (points,), behind the averages (traced)."""
        return power

    def drawn(self, rows: Any) -> Any:
        """Return the quantities (quantities, points) of simulated rows (points, rows) (traced)."""
        return rows.T

    @abstractmethod
    def synthetic(
        self, rows: Float[np.ndarray, "points rows"], noise: float, seed: int
    ) -> tuple[Float[np.ndarray, "points columns"], Float[np.ndarray, "points columns"]]:
        """Return the columns of `quantities` with noise and without, of simulated rows."""

    def chosen(self, parts: Sequence[str]) -> Signal:
        """Return the signal of some of its parts. Raises UsageError for unknown ones."""
        return replace(self, parts=tuple(parts))

    def against(self, sample: Any, reference: Any) -> Any:
        """Return the signal of a reflectance and that of the reference (traced)."""
        raise NotImplementedError

    # a fit

    def seen_in(self, scene: Any, depolarises: bool) -> Signal:
        """Return the signal as a scene explains it, in which some light may be unpolarised."""
        return self

    @abstractmethod
    def channels(self, data: Arrays, sigma: np.ndarray | None) -> Channels:
        """Return the measured values as they are compared; `sigma` is a guess where the data have none."""

    @abstractmethod
    def compared(self, rows: Any, frame: Any, depolarises: bool) -> Any:
        """Return the channels (..., points, channels) of simulated rows (..., points, rows)."""

    def groups(self, count: int, framed: bool) -> tuple[ChannelGroup, ...]:
        """Return the groups of `count` channels, in a frame or not, that have a noise of their own."""
        return tuple(ChannelGroup((channel,), 1) for channel in range(count))

    @property
    def outwards(self) -> int:
        """Number of channels in a frame in which nothing is measured; they are the last."""
        return 0

    def rms(self, residual: Float[np.ndarray, "*lanes points columns"]) -> Any:
        """Return the rms (*lanes) of residuals of the columns."""
        return np.sqrt(np.mean(residual**2, axis=(-2, -1)))

    def offsets(self, columns: Float[np.ndarray, "*lanes points columns"], allowed: Any) -> list[Offset]:
        """Return the errors that a `pellicle.Uncertainty` allows the instrument, at simulated
        columns."""
        return []

    def along(
        self, columns: Float[np.ndarray, "*lanes points columns"], change: np.ndarray, framed: bool
    ) -> np.ndarray:
        """Return a change of the channels without what Ψ and Δ do not depend on."""
        return change

    def polarised(self, columns: Float[np.ndarray, "*lanes points columns"]) -> np.ndarray:
        """Return N, C, S as simulated, shorter than 1, of columns with their depolarisation."""
        raise NotImplementedError

    def in_quantities(self, columns: Float[np.ndarray, "*lanes points columns"]) -> np.ndarray:
        """Return `quantities`, (*lanes, points, quantities), of simulated columns."""
        return columns

    def curves(
        self, data: np.ndarray, model: np.ndarray, weight: Float[np.ndarray, "points channels"]
    ) -> dict[str, np.ndarray]:
        """Return the arrays of a `fitting.curves.Curve`, of columns of data and model."""
        columns = {"data": data, "model": model, "sigma": 1 / weight}
        return columns if self.parts else {name: column.reshape(-1) for name, column in columns.items()}

    def residuals(self, data: Arrays, curve: Any, known: bool) -> list[Residuals]:
        """Return residuals of a fitted curve, over a given σ, else as they are; each column is one noise."""
        rows = curve.residual if data.sigma is None else curve.residual / data.sigma
        return [Residuals(column[:, None], known, len(rows)) for column in rows.reshape(len(rows), -1).T]
