"""Curves of a fit: data and model of each part, and the layer's index with standard errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, overload

import jax
import numpy as np

NORMAL = 1.959964
"""Quantile of the normal distribution at 95 %: the half width of an interval by its standard error."""
BIREFRINGENCE = "birefringence"
"""Name of the extraordinary index less the ordinary one among the principal indices."""


@dataclass(frozen=True)
class Index:
    """A layer's n and k with standard errors at each wavelength (nm), rising."""

    wavelength: np.ndarray
    n: np.ndarray
    k: np.ndarray
    n_stderr: np.ndarray
    k_stderr: np.ndarray

    def at(self, wavelengths: Sequence[float]) -> Index:
        """The index at those of its wavelengths that are nearest to some (nm)."""
        some = np.unique([int(np.argmin(np.abs(self.wavelength - nm))) for nm in wavelengths])
        return Index(*(getattr(self, f.name)[some] for f in fields(self)))

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Each wavelength, and n and k there: `n 3.29 ± 0.05, k 0.17 ± 0.02 (95 %)`."""
        columns = [getattr(self, f.name) for f in fields(self)]
        return [
            (f"{nm:.4g} nm", f"n {_amount(n, n_error)}, k {_amount(k, k_error)} (95 %)")
            for nm, n, k, n_error, k_error in zip(*columns, strict=True)
        ]


def _amount(value: float, stderr: float) -> str:
    error = NORMAL * stderr
    digits = max(0, min(6, 1 - math.floor(math.log10(error)))) if 0 < error < math.inf else 4
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def at_each_wavelength(curves: Sequence[Index | Curve | ColourCurve]) -> Index:
    """Return n and k of several curves at every wavelength of any of them, each once."""
    columns = {f.name: np.concatenate([getattr(c, f.name) for c in curves]) for f in fields(Index)}
    _, first = np.unique(columns["wavelength"], return_index=True)
    return Index(**{name: column[first] for name, column in columns.items()})


@dataclass(frozen=True)
class _WithIndex:
    """Data and model, and the layer's index with standard errors at each wavelength (nm).

    Of a birefringent layer `n` and `k` are the ordinary ones, and `principal` has each index by its name.
    """

    wavelength: np.ndarray
    data: np.ndarray
    sigma: np.ndarray
    model: np.ndarray
    n: np.ndarray
    k: np.ndarray
    n_stderr: np.ndarray
    k_stderr: np.ndarray
    principal: Mapping[str, Index] | None = None

    @property
    def residual(self) -> np.ndarray:
        return self.data - self.model


@dataclass(frozen=True)
class Curve(_WithIndex):
    """Data and model of a spectrum at each wavelength, and the layer's index with standard errors.

    For ellipsometry `data`, `model` and `sigma` are Ψ, and `delta_data` and `delta_model` Δ, in degrees
    (of generalised ones (wavelengths, ratios));
    `depolarisation_data` and `depolarisation_model` are fractions, None where it was not measured.
    """

    delta_data: np.ndarray | None = None
    delta_model: np.ndarray | None = None
    depolarisation_data: np.ndarray | None = None
    depolarisation_model: np.ndarray | None = None

    @property
    def delta_residual(self) -> np.ndarray:
        """Δ of the data less that of the model, in −180 to 180 degrees."""
        if self.delta_data is None or self.delta_model is None:
            raise ValueError("only ellipsometry has a Δ")
        return (self.delta_data - self.delta_model + 180.0) % 360.0 - 180.0

    @property
    def depolarisation_residual(self) -> np.ndarray:
        if self.depolarisation_data is None or self.depolarisation_model is None:
            raise ValueError("no depolarisation was measured")
        return self.depolarisation_data - self.depolarisation_model


@dataclass(frozen=True)
class BrdfCurve:
    """Model of BRDF samples, (samples, channels) in 1/sr, and residuals in the unit of the comparison."""

    model: np.ndarray
    residual: np.ndarray


@dataclass(frozen=True)
class ColourCurve(_WithIndex):
    """Colours of data and model, each (colours, 3) in the space of the data, with σ.

    `difference` (colours,) is ΔE*ab (CIE 1976), None for the channels of a camera. The layer's index, with
    standard errors, is that at the wavelengths (nm) of the sensor.
    """

    difference: np.ndarray | None = None


class Deferred(Sequence[Curve | ColourCurve | BrdfCurve]):
    """Curves that are computed, in float64, when one of them is first read."""

    def __init__(self, count: int, compute: Callable[[], tuple[Curve | ColourCurve | BrdfCurve, ...]]):
        self._count, self._compute = count, compute

    @cached_property
    def _computed(self) -> tuple[Curve | ColourCurve | BrdfCurve, ...]:
        with jax.enable_x64(True):
            return self._compute()

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> Curve | ColourCurve | BrdfCurve: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Curve | ColourCurve | BrdfCurve, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self._computed[index]

    def __reduce__(self) -> Any:
        return tuple, (self._computed,)
