"""Splines for n and k: no formula, only smoothness, and bounds that hold between the knots too.

A cubic B-spline is a weighted mean of its coefficients, with weights that are never negative
(C. de Boor, A Practical Guide to Splines, 2001, chapters IX and XI). So coefficients k ≥ 0 give
k ≥ 0 everywhere, the curve stays between its least and largest coefficient, and coefficients that
rise or fall give a curve that does. It is linear in the coefficients, which makes fits well behaved;
it meets the first and the last coefficient and passes near the others.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Any, ClassVar, final

import equinox as eqx
import numpy as np

from pellicle.dispersion.base import HC, AbstractDispersion, cast_like, require_nonnegative
from pellicle.optics.pair import Pair, namespace
from pellicle.optics.special import log_abs

POLE = 1.2
"""Energy of the pole for what absorbs above the knots, by that of the first knot. Of 1.2, 1.35 and 1.5 it
leaves the least errors of n in Fe2O3, TiO2, GaAs and CdS."""


def _knots(what: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(x) for x in what)


def _check(model: str, knots: tuple[float, ...], **coefficients: Any) -> None:
    if len(knots) < 2 or any(a >= b for a, b in itertools.pairwise(knots)) or knots[0] <= 0:
        raise ValueError(f"{model}: knots must be two or more rising wavelengths in nm, got {list(knots)}")
    for name, values in coefficients.items():
        if values is None:
            continue
        if len(values) != len(knots):
            raise ValueError(f"{model}: {name} needs one number a knot, {len(knots)}, got {len(values)}")
        for i, value in enumerate(values):
            require_nonnegative(model, **{f"{name}{i + 1}": value})


@final
class Spline(AbstractDispersion):
    """n and k as cubic B-splines in wavelength; beyond the knots their end values hold.

    `knots` are m ≥ 2 rising wavelengths in nm (fixed), `n` and `k` m coefficients each; `k=None`
    is a transparent medium. Fewer than four knots lower the degree. Inner knots of the B-spline are
    de Boor's averages, so that every coefficient belongs to one of `knots`.
    """

    knots: tuple[float, ...] = eqx.field(static=True, converter=_knots)
    n: tuple[Any, ...] = eqx.field(converter=tuple)
    k: tuple[Any, ...] | None = eqx.field(converter=lambda k: None if k is None else tuple(k), default=None)

    def __check_init__(self):
        _check("spline", self.knots, n=self.n, k=self.k)

    def index(self, wavelength):
        around, degree = greville_knots(self.knots)
        inside = namespace(wavelength).clip(wavelength, self.knots[0], self.knots[-1])
        basis = b_splines(inside, around, degree)
        n = _combine(basis, self.n)
        return n if self.k is None else Pair(n, _combine(basis, self.k))


@final
class KramersKronigSpline(AbstractDispersion):
    """k as a cubic B-spline in photon energy, and the n that Kramers and Kronig give it, plus poles outside.

    `knots` are m ≥ 2 rising wavelengths in nm (fixed) and `k` the m coefficients there. Beyond the outer
    knots, at sites spaced by the same ratio as the outermost pair, the end coefficients hold for one more and
    k then falls smoothly to zero. n is n_inf + A_uv/(E_uv² − E²) − A_ir/E² + (2/π) P∫ ξ k(ξ)/(ξ² − E²) dξ:
    the first three for what absorbs elsewhere, with E_uv `POLE` times the energy of the first knot (B. Johs
    and J. Hale, 2008, phys. stat. sol. (a) 205, 715); beyond that knot its term keeps its value. The integral
    is exact: each basis function is Σ wᵢ(ξ − tᵢ)₊³, whose integral is Σ wᵢ y³ ln|y| over y = tᵢ − E and
    tᵢ + E. That sum cancels: knots closer than 0.1 eV leave about 1e-9 in float64, and float32 is for widely
    spaced knots only (1e-5 at 0.5 eV).
    """

    units: ClassVar = {"A_uv": "eV²", "A_ir": "eV²"}
    kramers_kronig: ClassVar = True
    knots: tuple[float, ...] = eqx.field(static=True, converter=_knots)
    k: tuple[Any, ...] = eqx.field(converter=tuple)
    n_inf: Any = 1.5
    A_uv: Any = 0.0
    A_ir: Any = 0.0

    def __check_init__(self):
        _check("spline-kk", self.knots, k=self.k)
        require_nonnegative("spline-kk", n_inf=self.n_inf, A_uv=self.A_uv, A_ir=self.A_ir)

    def index(self, wavelength):
        energy = HC / wavelength
        sites = HC / np.array(self.knots[::-1])
        low, high = sites[0] / sites[1], sites[-1] / sites[-2]
        below, above = sites[0] * low ** np.array([3, 2, 1]), sites[-1] * high ** np.array([1, 2, 3])
        around = np.concatenate([below, sites, above])
        coefficients = (self.k[-1], *self.k[::-1], self.k[0])
        top = float(sites[-1])
        seen = namespace(energy).minimum(energy, top)
        poles = self.A_uv / ((POLE * top) ** 2 - seen * seen) - self.A_ir / (energy * energy)
        n = self.n_inf + poles + _combine(_conjugates(energy, around), coefficients)
        return Pair(n, _combine(b_splines(energy, around, 3), coefficients))


def greville_knots(sites: Sequence[float]) -> tuple[np.ndarray, int]:
    """Knots of the B-splines whose coefficients belong to `sites` (de Boor's averages), and their degree."""
    degree = min(3, len(sites) - 1)
    inner = [np.mean(sites[i : i + degree]) for i in range(1, len(sites) - degree)]
    return np.concatenate([[sites[0]] * (degree + 1), inner, [sites[-1]] * (degree + 1)]), degree


def _combine(basis: Any, coefficients: tuple[Any, ...]) -> Any:
    return sum(basis[..., i] * c for i, c in enumerate(coefficients))


def b_splines(x: Any, knots: np.ndarray, degree: int) -> Any:
    """The B-splines of a degree over rising `knots` at x, shape x.shape + (functions,). Cox, de Boor.

    Zero outside the knots; the last interval holds its right end.
    """
    xp = namespace(x)
    x, t = xp.asarray(x)[..., None], cast_like(knots, x)
    last = knots[1:] == knots[-1]
    held = (x >= t[:-1]) & ((x < t[1:]) | (xp.asarray(last & (knots[:-1] < knots[-1])) & (x <= t[-1])))
    basis = xp.where(held, xp.ones_like(x), xp.zeros_like(x))
    for d in range(1, degree + 1):
        spans = knots[d:] - knots[:-d]
        slope = cast_like(np.divide(1.0, spans, out=np.zeros_like(spans), where=spans > 0), x)
        rise = (x - t[:-d]) * slope
        fall = (t[d:] - x) * slope
        basis = rise[..., :-1] * basis[..., :-1] + fall[..., 1:] * basis[..., 1:]
    return basis


def _conjugates(energy: Any, knots: np.ndarray) -> Any:
    """(2/π) P∫ ξ B(ξ)/(ξ² − E²) dξ of every cubic B-spline over `knots`."""
    t = cast_like(knots, energy)
    below, above = t - energy[..., None], t + energy[..., None]
    parts = (below**3 * log_abs(below) + above**3 * log_abs(above)) / math.pi
    weights = np.zeros((len(knots), len(knots) - 4))
    for j in range(len(knots) - 4):
        five = knots[j : j + 5]
        for i in range(5):
            weights[j + i, j] = (five[4] - five[0]) / np.prod(five[i] - np.delete(five, i))
    return (parts[..., None] * cast_like(weights, energy)).sum(axis=-2)
