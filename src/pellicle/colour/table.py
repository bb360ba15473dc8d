"""Table of a film's colour over thickness and angle: one lookup replaces the integral over the spectrum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.colour import spaces
from pellicle.colour.bands import Bands
from pellicle.colour.film import Colour, reflectance
from pellicle.colour.observers import sensor
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Tabulated
from pellicle.optics.pair import namespace, real, to_pair

TOLERANCE = 0.05
"""Largest ΔE*ab of a table where none is given; its mean is then below 0.01."""
SLOPE_TOLERANCE = 0.005
"""Largest error of a derivative, relative to the largest derivative of the table."""
LARGEST = 1_000_000
"""Bytes of the largest table."""
_NODE = 48
"""Bytes of a node: twelve numbers in float32."""
REFERENCE = np.array([550.0])
"""Wavelength (nm) of the index by which the table follows the optical path."""
_PROBES, _BATCH = 1024, 1024

Colours = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Exact XYZ (N, 3) of films of thicknesses (N,), in nm, at cosines (N,) of the angle of incidence."""


class TableError(NamedTuple):
    """Error of a table against the exact integral, at 1024 random films.

    `mean` and `largest` are ΔE*ab (CIE 1976). `slope` is the largest error of the derivatives of XYZ in
    the thickness and in the cosine, relative to the largest such derivative.
    """

    mean: Any
    largest: Any
    slope: Any


@final
class FilmColourTable(eqx.Module):
    """Colour of one film against its thickness and the cosine of the angle of incidence, by one lookup.

    The table has XYZ and its derivatives, in float32, at nodes equally spaced in the optical path d·cos θ₁
    (θ₁ at the index of the layer at 550 nm) and in the cosine. Along lines of constant path the fringes do
    not move, so that few cosines suffice. Between nodes it is a bicubic Hermite spline, continuous with its
    first derivatives. `build` makes the table of a layer on a substrate, `from_colours` of anything else.

    Beyond 80° the colours of a film between equal media change too fast for so few nodes: `error` is then
    larger than asked for. Thicknesses and cosines outside the table take the colour of its edge, with
    derivative 0.

    ```python
    >>> FilmColourTable.build(1.33, 1.0, (0, 600))(300.0, 1.0).srgb.round(2).tolist()
    [0.23, 0.31, 0.2]

    ```
    """

    nodes: Float[Array, "paths cosines 12"]
    path: Float[Array, "2"]  # nm: of the first and the last node
    cosine: Float[Array, "2"]
    shear: Float[Array, ""]  # 1/n² of the layer against the ambient; 0 where paths are plain thicknesses
    error: TableError
    white: tuple[float, float, float] = eqx.field(static=True)

    @classmethod
    def build(
        cls,
        layer: Any,
        substrate: Any,
        thickness: tuple[float, float],
        *,
        ambient: Any = 1.0,
        angle: tuple[float, float] = (0.0, 80.0),
        illuminant: str = "D65",
        observer: str = "1931",
        tolerance: float = TOLERANCE,
    ) -> FilmColourTable:
        """Build the table of a layer on a half space in unpolarised light.

        The spectrum is integrated in steps of 1 nm, in double precision.

        **Arguments:** `thickness` (nm) and `angle` of incidence (degrees) are ranges; `tolerance` is the
        largest ΔE*ab; the rest as for `pellicle.colour.film_colour`.

        **Raises:** ValueError as `film_colour` and `from_colours` do.
        """
        eye = sensor(observer, illuminant)
        media = [_tabulated(medium, eye.wavelength) for medium in (layer, substrate, ambient)]
        n1, n0 = (real(_tabulated(medium, REFERENCE).value)[0] for medium in (layer, ambient))

        def colours(thickness: np.ndarray, cosine: np.ndarray) -> np.ndarray:
            with jax.enable_x64(True):
                return np.asarray(_exact(thickness, cosine, media, eye.wavelength, eye.weights))

        return cls.from_colours(
            colours, thickness, white=eye.white, angle=angle, index=float(n1 / n0), tolerance=tolerance
        )

    @classmethod
    def from_colours(
        cls,
        colours: Colours,
        thickness: tuple[float, float],
        *,
        white: Sequence[float] | np.ndarray,
        angle: tuple[float, float] = (0.0, 80.0),
        index: float = 1.0,
        tolerance: float = TOLERANCE,
    ) -> FilmColourTable:
        """Build the table of any function of thickness and cosine.

        Nodes are added along the axis that gains more, until the measured errors are small enough or the
        table has 1 MB; `error` is what was reached.

        **Arguments:**

        - `colours`: exact XYZ (1024, 3) at thicknesses (1024,) in nm and cosines (1024,).
        - `thickness` (nm), `angle` (degrees): ranges.
        - `white`: XYZ of the white, (3,).
        - `index`: of the layer, relative to the ambient. It sets the lines of constant path, no colour.
        - `tolerance`: largest ΔE*ab.

        **Raises:** ValueError for an empty range, and for colours that are not finite.
        """
        low, high = (np.cos(np.deg2rad(x)) for x in (angle[1], angle[0]))
        if not (0 <= thickness[0] < thickness[1] < np.inf and 0 <= low < high <= 1):
            raise ValueError(
                "a table needs a rising `thickness` (nm) and a rising `angle` within 0 to 90 degrees, got"
                f" {thickness} and {angle}"
            )
        shear = np.float64(1 / index**2 if index > 1 else 0.0)  # total reflection: no fringe rests on a path
        colours = _in_batches(colours)
        path = np.array([thickness[0] * _shortening(low, shear), thickness[1] * _shortening(high, shear)])
        grid = _Grid(path, np.array([low, high]), np.array(shear))
        probes = _probes(colours, thickness, (low, high))

        def attempt(counts: np.ndarray) -> Attempt:
            nodes = _nodes(colours, grid, counts)
            return counts, nodes, probes.error(nodes, grid, np.asarray(white))

        start = np.array([max(16, int(np.ptp(thickness) * index / 25)), 12])
        nodes, error = _refined(attempt, start, tolerance)
        x, y, z = map(float, white)
        nodes, paths, cosines, shear = (jnp.asarray(each, jnp.float32) for each in (nodes, *grid))
        return cls(nodes, paths, cosines, shear, error, (x, y, z))

    def xyz(self, thickness: Any, cosine: Any = 1.0) -> Float[Array, "... 3"]:
        """XYZ (..., 3) at thicknesses (nm) and cosines of the angle of incidence, which broadcast."""
        films = jnp.broadcast_arrays(*(jnp.asarray(x, self.nodes.dtype) for x in (thickness, cosine)))
        return _compiled(self.nodes, _Grid(self.path, self.cosine, self.shear), *films)

    def __call__(self, thickness: Any, cosine: Any = 1.0) -> Colour:
        """Colour at thicknesses (nm) and cosines of the angle of incidence, which broadcast."""
        return Colour(self.xyz(thickness, cosine), self.white)

    def evaluate(self, thickness: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        """XYZ (..., 3) as `xyz`, in NumPy: nothing is compiled."""
        nodes, *grid = (np.asarray(x) for x in (self.nodes, self.path, self.cosine, self.shear))
        return _interpolated(nodes, _Grid(*grid), *np.broadcast_arrays(thickness, cosine))

    @property
    def thickness(self) -> tuple[float, float]:
        """Range of the thickness in nm."""
        ends = [float(u / _shortening(c, self.shear)) for u, c in zip(self.path, self.cosine, strict=True)]
        return float(f"{ends[0]:.6g}"), float(f"{ends[1]:.6g}")  # float32 has no more digits

    @property
    def nbytes(self) -> int:
        """Bytes of the table."""
        return self.nodes.nbytes


class _Grid(NamedTuple):
    """Positions of the nodes: the first and the last path (nm) and cosine, and the shear of the paths."""

    path: Any
    cosine: Any
    shear: Any


Attempt = tuple[np.ndarray, np.ndarray, TableError]
"""Numbers of nodes along both axes, the nodes, and their error."""


def _refined(
    attempt: Callable[[np.ndarray], Attempt], counts: np.ndarray, tolerance: float
) -> tuple[np.ndarray, TableError]:
    """Add nodes along the axis that gains more, until the error is small enough or the table is full."""
    counts, nodes, error = attempt(counts)
    while error.largest > tolerance or error.slope > SLOPE_TOLERANCE:
        finer = [counts * 3 // 2 * mask + counts * (1 - mask) for mask in np.eye(2, dtype=int)]
        if any(np.prod(each) * _NODE > LARGEST for each in finer):
            break
        counts, nodes, error = min(
            map(attempt, finer),
            key=lambda made: max(made[2].largest / tolerance, made[2].slope / SLOPE_TOLERANCE),
        )
    return nodes, error


def _shortening(cosine: Any, shear: Any) -> Any:
    """cos θ₁: the optical path in the layer relative to that at normal incidence."""
    return namespace(cosine).sqrt(1.0 - (1.0 - cosine * cosine) * shear)


def _interpolated(nodes: Any, grid: _Grid, thickness: Any, cosine: Any) -> Any:
    """XYZ (..., 3) between the nodes."""
    paths, cosines, _ = nodes.shape
    xp = namespace(nodes)
    cosine = xp.clip(cosine, grid.cosine[0], grid.cosine[1])
    path = thickness * _shortening(cosine, grid.shear)
    row, along = _cell(path, grid.path, paths, xp)
    column, across = _cell(cosine, grid.cosine, cosines, xp)
    total: Any = 0.0
    for i, (value_u, slope_u) in enumerate(along):
        for j, (value_c, slope_c) in enumerate(across):
            node = nodes[row + i, column + j]
            weights = (value_u * value_c, slope_u * value_c, value_u * slope_c, slope_u * slope_c)
            for k, weight in enumerate(weights):
                total = total + weight[..., None] * node[..., 3 * k : 3 * k + 3]
    return total


_compiled = jax.jit(_interpolated)


def _cell(coordinate: Any, span: Any, count: int, xp: Any) -> tuple[Any, tuple[Any, Any]]:
    """Cell of a coordinate, and Hermite's weights of value and slope at its two nodes."""
    position = xp.clip((coordinate - span[0]) * ((count - 1) / (span[1] - span[0])), 0.0, count - 1.0)
    cell = xp.minimum(position.astype("int32"), count - 2)
    f = position - cell
    g = 1.0 - f
    return cell, ((g * g * (1 + 2 * f), f * g * g), (f * f * (3 - 2 * f), -f * f * g))


def _in_batches(colours: Colours) -> Colours:
    """The function for any number of films, in calls of one size, for which it is compiled once."""

    def any_number(thickness: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        more = -len(thickness) % _BATCH
        rows = np.pad(np.stack([thickness, cosine]), ((0, 0), (0, more)), "edge").reshape(2, -1, _BATCH)
        return np.concatenate([colours(*row) for row in rows.swapaxes(0, 1)])[: len(thickness)]

    return any_number


def _nodes(colours: Colours, grid: _Grid, counts: np.ndarray) -> np.ndarray:
    """XYZ at the nodes and its derivatives in units of the cells, by cubic splines."""
    from scipy.interpolate import CubicSpline  # slow to import

    u, c = (np.linspace(s[0], s[1], n) for s, n in zip((grid.path, grid.cosine), counts, strict=True))
    path, cosine = (x.ravel() for x in np.meshgrid(u, c, indexing="ij"))
    value = colours(path / _shortening(cosine, grid.shear), cosine).reshape(*counts, 3)
    if not np.all(np.isfinite(value)):
        raise ValueError("the film has no finite colour somewhere in these ranges of thickness and angle")
    by_path = CubicSpline(u, value, axis=0)(u, 1) * (u[1] - u[0])
    by_cosine, cross = (CubicSpline(c, x, axis=1)(c, 1) * (c[1] - c[0]) for x in (value, by_path))
    return np.concatenate([value, by_path, by_cosine, cross], axis=-1)


class _Probes(NamedTuple):
    """Random films, with their exact colours and slopes."""

    thickness: np.ndarray
    cosine: np.ndarray
    xyz: np.ndarray
    slopes: list[np.ndarray]  # in thickness and in cosine
    steps: tuple[float, float]  # of the differences that give the slopes

    def error(self, nodes: np.ndarray, grid: _Grid, white: np.ndarray) -> TableError:
        def table(thickness: np.ndarray, cosine: np.ndarray) -> np.ndarray:
            return _interpolated(nodes, grid, thickness, cosine)

        lab = [np.asarray(spaces.lab(x, white)) for x in (table(self.thickness, self.cosine), self.xyz)]
        missed = np.linalg.norm(lab[0] - lab[1], axis=-1)
        slopes_of_table = _slopes(table, self.thickness, self.cosine, self.steps)
        slopes = zip(slopes_of_table, self.slopes, strict=True)
        worst = max(np.max(np.abs(one - exact)) / np.max(np.abs(exact)) for one, exact in slopes)
        return TableError(missed.mean(), missed.max(), worst)


def _probes(colours: Colours, thickness: tuple[float, float], cosine: tuple[float, float]) -> _Probes:
    draws = np.random.default_rng(0).uniform(0.001, 0.999, (2, _PROBES))
    nm, cosines = (
        low + draw * (high - low) for draw, (low, high) in zip(draws, (thickness, cosine), strict=True)
    )
    steps = (1e-4 * (thickness[1] - thickness[0]), 1e-4 * (cosine[1] - cosine[0]))
    return _Probes(nm, cosines, colours(nm, cosines), _slopes(colours, nm, cosines, steps), steps)


def _slopes(
    colours: Colours, thickness: np.ndarray, cosine: np.ndarray, steps: tuple[float, float]
) -> list[np.ndarray]:
    """Derivatives of XYZ in thickness and in cosine, by central differences."""
    slopes = []
    for nm, tilt in ((steps[0], 0.0), (0.0, steps[1])):
        above, below = (colours(thickness + s * nm, cosine + s * tilt) for s in (1, -1))
        slopes.append((above - below) / (2 * (nm + tilt)))
    return slopes


@jax.jit
def _exact(
    thickness: Any, cosine: Any, media: list[AbstractDispersion], wavelength: Any, weights: Any
) -> Any:
    layer, substrate, ambient = media
    degrees = jnp.rad2deg(jnp.arccos(cosine))
    bands = Bands(wavelength, None, weights)
    return reflectance(thickness, layer, substrate, bands, ambient=ambient, angle=degrees) @ weights


def _tabulated(medium: Any, wavelength: np.ndarray) -> Tabulated:
    """The index of a material or a number at these wavelengths."""
    if isinstance(medium, AbstractDispersion):
        return Tabulated(wavelength, known_index(medium, wavelength), None)
    return Tabulated(wavelength, to_pair(np.asarray(medium) * np.ones(len(wavelength))), None)
