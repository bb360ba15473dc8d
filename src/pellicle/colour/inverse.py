"""Thicknesses of a film from its colours: every admissible order with its probability."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pellicle.colour.spaces import Encoding, encoding, lab
from pellicle.colour.table import FilmColourTable

SIGMA = 1.5 / 255
"""Standard deviation of a channel of 8-bit sRGB: a good camera's noise and rounding."""
SURE = 0.995
"""Probability of the best order below which a colour is ambiguous. At 0.98, 5 to 12 % of the wrong orders
were not called so (1500 colours of SiO₂ on Si, of hematite and of soap films)."""
MISFIT_LEVEL = 1e-4
"""Probability of a χ² as large as that of a misfit."""
_PRUNED, _SCREENED = 30.0, 90.0
"""χ² above the least beyond which a thickness is dropped, and beyond which it is not computed exactly."""
_APART = 1.5
"""Two maxima nearer than this many times the sum of their standard deviations are one order."""
_STEP = 1.01
Errors = Callable[[np.ndarray], Sequence[np.ndarray]]
"""Function from linear channels (..., 3) to changes of them by one standard uncertainty of each error."""
_MANY, _CHUNK = 4096, 2_000_000
_FINEST, _COARSEST, _MOST = 0.02, 1.0, 16_384


class ColourThickness(NamedTuple):
    """Thicknesses of colours, most probable first.

    Arrays have the shape of the colours, then the orders; NaN where a colour has fewer orders. An order is a
    maximum of the posterior with the thicknesses around it.
    """

    thickness: np.ndarray  # nm: posterior mean within the order
    stderr: np.ndarray  # nm: posterior standard deviation within the order
    probability: np.ndarray  # of the order; the sum is below 1 where orders are left out
    delta_e: np.ndarray  # mean ΔE*ab (CIE 1976) over the angles, at the best thickness of the order
    exposure: np.ndarray
    chi2: np.ndarray  # least of the order
    status: np.ndarray  # without orders: converged, ambiguous, at-bound, misfit or not-identifiable


@dataclass(frozen=True)
class ColourInverse:
    """Inverse from colours to thicknesses for one film, geometry, camera and noise.

    `build` computes the colours of the film at a grid of thicknesses, about one σ of a colour apart. A call
    then takes under 1 ms for a colour, and 0.1 ms in an image. The arguments of `build` are those of
    `invert`.
    """

    thickness: np.ndarray  # (grid,), nm
    width: np.ndarray  # (grid,), nm: weights of the integral over the thickness
    channels: np.ndarray  # (grid, angles, 3): linear
    roots: np.ndarray  # (grid, angles, 3): to the power of the space
    homogeneous: np.ndarray  # (grid, channels): the part proportional to the gain, over σ
    space: Encoding
    sigma: np.ndarray  # (channels,)
    gain: tuple[float, float]  # exposure to the power of the space
    white: np.ndarray
    single: bool  # one angle, for which colours have no axis
    errors: Errors | None = None  # of the camera

    @classmethod
    def build(
        cls,
        table: FilmColourTable,
        angle: Any = 0.0,
        *,
        space: str = "srgb",
        sigma: Any = SIGMA,
        exposure: float | tuple[float, float] = 1.0,
        thickness: tuple[float, float] | None = None,
        errors: Errors | None = None,
    ) -> ColourInverse:
        """Compute the colours. Arguments and errors are those of `invert`."""
        angles, code = np.atleast_1d(np.asarray(angle, float)), encoding(space, table.white)
        low, high = table.thickness if thickness is None else thickness
        limits = np.array(exposure if np.ndim(exposure) else (exposure, exposure), float)
        if not table.thickness[0] <= low < high <= table.thickness[1]:
            raise ValueError(f"`thickness`: expected a range within that of the table, {table.thickness} nm")
        if not np.all(np.cos(np.deg2rad(angles)) > table.cosine[0] - 1e-6):
            limit = np.rad2deg(np.arccos(table.cosine[0]))
            raise ValueError(f"`angle`: the table ends at {limit:.4g} degrees, got {angle}")
        if not 0 < limits[0] <= limits[1] < np.inf:
            raise ValueError(f"`exposure`: expected a number above 0 or a rising range, got {exposure}")
        if not np.all(np.asarray(sigma) > 0):
            raise ValueError(f"`sigma` must be above 0, got {sigma}")
        deviation = np.tile(np.broadcast_to(np.asarray(sigma, float), 3), len(angles))
        gain = limits**code.power
        cosine = np.cos(np.deg2rad(angles))

        def exposed(nm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            channels = code.channels(table.evaluate(nm[:, None], cosine))
            return channels, code.roots(channels)

        trial = np.linspace(low, high, 4096)
        shown = exposed(trial)
        brightest = np.clip(1 / np.maximum(np.max(shown[1]), 1e-9), *gain)  # brighter ones are clipped
        coded = code.encode(*shown, brightest).reshape(len(trial), -1) / deviation
        apart = np.linalg.norm(np.diff(coded, axis=0), axis=1) / np.diff(trial)  # σ per nm
        density = np.clip(apart, 1 / _COARSEST, 1 / _FINEST)
        length = np.concatenate([[0.0], np.cumsum(density * np.diff(trial))])
        count = int(np.clip(np.ceil(length[-1]), 16, _MOST))
        grid = np.interp(np.linspace(0.0, length[-1], count), length, trial)
        channels, roots = exposed(grid)
        middle, known = np.sqrt(gain[0] * gain[1]), gain[0] == gain[1]
        coded = code.encode(channels, roots, middle, highest=1.0 if known else np.inf)
        homogeneous = (coded - code.base).reshape(count, -1) / deviation / middle
        known_as = (float(gain[0]), float(gain[1]))
        return cls(
            *(grid, np.gradient(grid), channels, roots, homogeneous, code, deviation, known_as),
            *(np.asarray(table.white), np.ndim(angle) == 0, errors),
        )

    def __call__(self, colours: Any, orders: int = 8) -> ColourThickness:
        """Return the thicknesses of colours (..., 3), or (..., angles, 3), as `invert` does."""
        data, angles = np.asarray(colours, float), self.channels.shape[1]
        if self.single:
            data = data[..., None, :]
        if data.ndim < 2 or data.shape[-2:] != (angles, 3):
            expected = "(..., 3) for one angle" if self.single else f"(..., {angles}, 3) for these angles"
            raise ValueError(f"`colours`: expected {expected}, got {np.shape(colours)}")
        if not np.all(np.isfinite(data)):
            raise ValueError("`colours` must be finite numbers")
        shape, flat = data.shape[:-2], data.reshape(-1, 3 * angles)
        where: Any = slice(None)
        if len(flat) > _MANY:  # 8-bit images repeat their colours
            flat, where = np.unique(flat, axis=0, return_inverse=True)
        chunk = max(1, _CHUNK // len(self.thickness))
        chunks = [_orders(flat[i : i + chunk], self, orders) for i in range(0, len(flat), chunk)]
        columns = [np.concatenate(column)[where] for column in zip(*chunks, strict=True)]
        return ColourThickness(*(x.reshape((*shape, *x.shape[1:])) for x in columns))

    def missed(self, colours: np.ndarray, node: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Residuals over σ (N, channels) of colours (N, channels) at nodes of the grid."""
        shown = self.space.encode(self.channels[node], self.roots[node], gain[:, None])
        return (shown.reshape(colours.shape) - colours) / self.sigma

    def precision(self, colours: np.ndarray) -> np.ndarray:
        """Inverse covariance (N, channels, channels) of noise and camera errors of colours (N, channels), in
        units of σ. Errors are taken to first order at the measured colours; a clipped channel has none."""
        count = colours.shape[1]
        covariance = np.broadcast_to(np.eye(count), (len(colours), count, count))
        if self.errors is not None:
            linear = self.space.decoded(colours.reshape(len(colours), -1, 3))
            inside = _inside(colours, self.space) / self.sigma
            rise = self.space.rise(linear)
            for change in self.errors(linear):
                coded = np.einsum("naij,naj->nai", rise, change).reshape(colours.shape) * inside
                covariance = covariance + coded[:, :, None] * coded[:, None, :]
        return np.linalg.inv(covariance)


def invert(
    table: FilmColourTable, colours: Any, angle: Any = 0.0, *, orders: int = 8, **how: Any
) -> ColourThickness:
    """Return every admissible thickness of measured colours, with its probability.

    `ColourInverse` does the same for many calls.

    The posterior of the thickness is computed on a grid as fine as σ resolves, from a table of colours.
    It is uniform in the thickness before the measurement, and in the logarithm of a free exposure.

    **Arguments:**

    - `table`: colours of the film (`FilmColourTable.build`), under the lamp of the measurement.
    - `colours`: (..., 3) at one `angle`, (..., angles, 3) at several.
    - `angle`: of incidence in degrees, one or (angles,).
    - `orders`: the largest number of orders returned.
    - `space`: "srgb" (0 to 1, display values), "linear-rgb", "xyz" (Y = 1 for a perfect reflector) or "lab".
    - `sigma`: standard deviation of a channel, one or (3,), in the unit of the space.
    - `exposure`: factor between the film's colours and the measured ones, relative to a perfect reflector:
      a number where it is known, (lowest, highest) where it is free and common to all angles of a colour.
    - `thickness`: range (nm) within that of the table, which is the default.
    - `errors`: function from linear channels (..., 3) to a list of changes of them (..., 3), each by one
      standard uncertainty of an error of the camera, common to all channels and angles of a colour. They add
      to the covariance of σ.

    sRGB channels of 0 and 1 are limits: the film may be darker or brighter.

    **Returns:** `ColourThickness`, whose `status` is the first that holds:

    - `misfit`: no thickness has these colours within the noise;
    - `not-identifiable`: nearly all thicknesses have;
    - `ambiguous`: the probability of the best order is below 0.995;
    - `at-bound`: the best thickness is the end of the range, and not 0;
    - `converged`.

    **Raises:** ValueError for an unknown space, and for shapes, a σ, an exposure or a range that cannot be.
    """
    return ColourInverse.build(table, angle, **how)(colours, orders)


def _inside(colours: np.ndarray, space: Encoding) -> np.ndarray:
    """1 where a channel (N, channels) is a measurement, 0 where it is a limit."""
    return ((colours > 0) & (colours < 1)).astype(float) if space.clips else np.ones_like(colours)


def _screened(
    colours: np.ndarray, model: ColourInverse, precision: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """χ² (colours, grid) by linear regression on the gain, and the gain.

    Channels at their limits are left out, and dark ones follow the power: it is exact for a known exposure.
    """
    space, angles = model.space, model.channels.shape[1]
    inside = _inside(colours, space)
    within = (precision * inside[:, :, None] * inside[:, None, :]).astype(np.float32)
    value = ((colours - np.tile(space.base, angles)) / model.sigma).astype(np.float32)
    weighted = np.einsum("nij,nj->ni", within, value)
    h = model.homogeneous.astype(np.float32)
    products = (h[:, :, None] * h[:, None, :]).reshape(len(h), -1)
    along, square = weighted @ h.T, within.reshape(len(within), -1) @ products.T
    gain = np.clip(along / np.maximum(square, 1e-20), *np.array(model.gain, np.float32))
    chi2 = np.sum(weighted * value, axis=1)[:, None] + gain * (gain * square - 2 * along)
    return chi2, gain


def _posterior(colours: np.ndarray, model: ColourInverse) -> tuple[np.ndarray, ...]:
    """Nodes of the grid that may have made colours (colours, channels): the colour and the node of each,
    its gain, χ², and ln of the posterior density up to a constant of the colour."""
    each = np.arange(len(colours))
    precision = model.precision(colours)
    chi2, gain = _screened(colours, model, precision)
    row, node = np.nonzero(chi2 < chi2.min(axis=1, keepdims=True) + _SCREENED)
    gain = gain[row, node].astype(float)
    whitening = np.linalg.cholesky(precision)

    def missed_at(gain: np.ndarray) -> np.ndarray:
        """Residuals (N, channels) in standard deviations of noise and errors, without correlation."""
        return np.einsum("nij,ni->nj", whitening[row], model.missed(colours[row], node, gain))

    missed = missed_at(gain)
    log_volume: Any = 0.0
    if model.gain[1] > model.gain[0]:  # one step of Gauss and Newton in ln(gain), exact for dark channels
        slope = (missed_at(gain * _STEP) - missed) / np.log(_STEP)
        curvature = np.sum(slope * slope, axis=1)
        gain = gain * np.exp(
            np.clip(-np.sum(slope * missed, axis=1) / np.maximum(curvature, 1e-9), -0.2, 0.2)
        )
        gain = np.clip(gain, *model.gain)
        missed = missed_at(gain)
        # width of the likelihood in ln(gain), at most that of the prior
        log_volume = -0.5 * np.log(curvature / (2 * np.pi) + np.log(model.gain[1] / model.gain[0]) ** -2)
    chi2 = np.sum(missed * missed, axis=1)
    log_p = log_volume - 0.5 * chi2
    peak = np.maximum.reduceat(log_p, np.searchsorted(row, each))
    kept = log_p > (peak - _PRUNED)[row]
    return tuple(x[kept] for x in (row, node, gain, chi2, log_p - peak[row]))


def _orders(colours: np.ndarray, model: ColourInverse, most: int) -> tuple[np.ndarray, ...]:
    """The columns of `ColourThickness` of colours (colours, channels)."""
    each = np.arange(len(colours))
    row, node, gain, chi2, log_p = _posterior(colours, model)
    mass = np.exp(log_p) * model.width[node]

    def summed(first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mass, mean and standard deviation of the thicknesses from each of these to the next."""
        nm = model.thickness[node]
        part, mean, square = (np.add.reduceat(mass * x, first) for x in (np.ones_like(nm), nm, nm * nm))
        mean, square = mean / part, square / part
        return part, mean, np.sqrt(np.clip(square - mean**2, 0.0, None) + model.width[node[first]] ** 2 / 12)

    first = _boundaries(row, node, log_p)
    _, mean, spread = summed(first)
    near = np.diff(mean) < _APART * (spread[1:] + spread[:-1])
    first = first[np.concatenate([[True], (np.diff(row[first]) != 0) | ~near])]
    part, mean, spread = summed(first)
    owner = row[first]
    probability = part / np.add.reduceat(mass, np.searchsorted(row, each))[owner]
    order = np.cumsum(np.isin(np.arange(len(row)), first)) - 1
    best = np.lexsort((-log_p, order))[np.searchsorted(order, np.arange(len(first)))]

    exposure = gain[best] ** (1 / model.space.power)
    shown = _delta_e(colours[owner], model, node[best], gain[best])
    columns = (mean, spread, probability, shown, exposure, chi2[best])
    ranking, result = _ranked(columns, owner, len(each), most)
    last = len(model.thickness) - 1
    ends = (node[best] == last) | ((node[best] == 0) & (model.thickness[0] > 0))
    return *result, _status(result[1:], ends[ranking], colours.shape[1], model)


def _ranked(
    columns: tuple[np.ndarray, ...], owner: np.ndarray, colours: int, most: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """The most probable order of each colour, and columns of orders as (colours, most), NaN beyond the last.

    `columns` begin with mean, spread and probability; `owner` is the colour of each order.
    """
    ranking = np.lexsort((-columns[2], owner))
    rank = np.arange(len(owner)) - np.searchsorted(owner, owner[ranking])
    first = ranking[rank == 0]
    ranking, rank = ranking[rank < most], rank[rank < most]
    tables = []
    for column in columns:
        table = np.full((colours, most), np.nan)
        table[owner[ranking], rank] = column[ranking]
        tables.append(table)
    return first, tables


def _boundaries(row: np.ndarray, node: np.ndarray, log_p: np.ndarray) -> np.ndarray:
    """First position of every order: a new colour, a gap in the grid or a minimum of the posterior."""
    follows = (np.diff(row) == 0) & (np.diff(node) == 1)
    falls, rises = np.diff(log_p) < 0, np.diff(log_p) >= 0
    minimum = np.concatenate([[False], (follows & falls)[:-1] & (follows & rises)[1:], [False]])
    return np.flatnonzero(np.concatenate([[True], ~follows]) | minimum)


def _delta_e(colours: np.ndarray, model: ColourInverse, node: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Mean ΔE*ab over the angles between measured colours and those of the film."""
    shown = model.space.encode(model.channels[node], model.roots[node], gain[:, None])
    one, other = (
        np.asarray(lab(model.space.decode(x), model.white)) for x in (shown, colours.reshape(shown.shape))
    )
    return np.linalg.norm(one - other, axis=-1).mean(axis=-1)


def _status(
    columns: Sequence[np.ndarray], ended: np.ndarray, channels: int, model: ColourInverse
) -> np.ndarray:
    """Status of each colour from the columns of its orders, `stderr` to `chi2`."""
    from scipy.special import chdtri  # slow to import

    stderr, probability, *_, chi2 = columns
    freedom = max(channels - 1 - (model.gain[1] > model.gain[0]), 1)
    unlike = np.nanmin(chi2, axis=1) > chdtri(freedom, MISFIT_LEVEL)
    blind = stderr[:, 0] > 0.2 * np.ptp(model.thickness)  # a uniform posterior has 0.29
    names = ["misfit", "not-identifiable", "ambiguous", "at-bound"]
    return np.select([unlike, blind, probability[:, 0] < SURE, ended], names, "converged")
