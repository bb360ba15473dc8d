"""Fits of spectra as a pure function, for `jax.jit` and `jax.vmap`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.coordinates import Array, Box
from pellicle.fitting.evaluation import Static, Until, explained, polished
from pellicle.fitting.film.fit import measurements
from pellicle.fitting.film.problem import make
from pellicle.fitting.minima import MOST, STEPS
from pellicle.fitting.problem import Member
from pellicle.scene.film import Scene


@final
class Prepared(eqx.Module):
    """Spectra and their scene as arrays: a pytree whose static part is the form of the simulation.

    Problems of one kind of scene and of as many points have the same structure whatever their numbers are, so
    that `jax.tree.map(lambda *x: jnp.stack(x), *problems)` makes one problem of many, for
    `jax.vmap(pl.fitting.solve)`.

    - `names`: of the free parameters, in the order of all arrays of parameters.
    - `lower`, `upper`: their bounds, each (parameters,), in their own units (thickness in nm).
    """

    _arrays: tuple[Any, ...]
    _box: Box
    _static: Static = eqx.field(static=True)
    _shapes: tuple[tuple[int, int], ...] = eqx.field(static=True)  # wavelengths and data values of each
    names: tuple[str, ...] = eqx.field(static=True)

    @property
    def lower(self) -> Array:
        return self._box.lower

    @property
    def upper(self) -> Array:
        return self._box.upper

    def log_density(self, values: ArrayLike) -> Array:
        """Log of the likelihood times the priors at `values` (parameters,), up to a constant, for samplers.

        Scale, offset and other linear nuisances are integrated out. Pure and differentiable, also by reverse
        mode; the bounds are left to the caller. Without a σ of the data that of the first guess is used.
        """
        values = jnp.asarray(values)
        box = self._box
        views, at = explained(self._static, self._arrays, box, (values - box.lower) / (box.upper - box.lower))
        return -0.5 * (sum(view.deviance for view in views) + jnp.sum(box.prior_rows(at) ** 2))

    def with_data(self, values: ArrayLike, sigma: ArrayLike | None = None, *, spectrum: int = 0) -> Prepared:
        """The problem with other values of one of its spectra, for `jax.vmap` over data.

        **Arguments:**

        - `values`: reflectance or transmittance, (points,), by increasing wavelength.
        - `sigma`: standard deviations, (points,) or one number; those of the prepared spectrum if None.
        - `spectrum`: position of the spectrum in a joint problem.

        **Raises:** UsageError for ellipsometry, which `prepare` takes; ValueError for other numbers.
        """
        scene, data = self._arrays[spectrum]
        points, _ = self._shapes[spectrum]
        if scene.light.ellipsometric:
            raise UsageError(
                "`values` of ellipsometry cannot be replaced: prepare and stack a problem of each"
            )
        values = jnp.asarray(values)
        if values.shape != (points,):
            raise ValueError(f"`values`: expected one number per wavelength ({points},), got {values.shape}")
        padding = len(data.values) - points
        level = jnp.maximum(jnp.median(jnp.abs(values)), 1e-12)
        data = data._replace(values=jnp.pad(values, (0, padding), mode="edge"), level=level)
        if sigma is not None:
            weight = 1 / jnp.broadcast_to(jnp.asarray(sigma), (points,))
            data = data._replace(weight=jnp.pad(weight, (0, padding)))
        arrays = list(self._arrays)
        arrays[spectrum] = scene, data
        return replace(self, _arrays=tuple(arrays))


class Solution(NamedTuple):
    """Local minima below the starts, in their order.

    - `values`: parameters in their own units, (starts, parameters).
    - `deviance`: −2 ln likelihood up to a constant, priors included, (starts,).
    - `converged`: whether the solver settled, (starts,).
    - `steps`: evaluations, (starts,).
    """

    values: Any
    deviance: Any
    converged: Any
    steps: Any


def prepare(
    data: Spectrum | Sequence[Spectrum], scene: Scene | Sequence[Scene], *, tolerance: float = 0.0
) -> Prepared:
    """Prepare the problem of fitting `scene` to spectra, for `pellicle.fitting.solve`.

    Reads media and chooses effects; not to be traced. `data`, `scene` and `tolerance` are as in
    `pellicle.fit`. Where a spectrum has no σ, weights are the first guess of `pellicle.fit`, which it then
    replaces by the rms of the residuals.

    **Returns:** `Prepared`, in float64.

    **Raises:** as `pellicle.fit` does.
    """
    with jax.enable_x64(True):
        problem = make(*measurements(data, scene), tolerance=tolerance)
        arrays, box = jax.tree.map(np.asarray, (problem.arrays, problem.box))
    shapes = tuple((view.rows, view.points) for view in problem.views)
    return Prepared(arrays, box, problem.static, shapes, tuple(p.name for p in problem.parameters))


def solve(problem: Prepared, starts: ArrayLike, *, steps: int = STEPS) -> Solution:
    """Compute the local minimum below each start: the core of `pellicle.fit`, without its search and errors.

    Pure: works under `jax.jit` and under `jax.vmap` over `problem`, `starts` or both, in float32 or, with
    JAX's x64 on, in float64. `pellicle.fit` computes in float64; do so too for errors below 1e-3 of a
    parameter. Not differentiable.

    **Arguments:**

    - `problem`: from `pellicle.fitting.prepare`.
    - `starts`: (starts, parameters), in the parameters' own units and in the order of `problem.names`.
      Interference gives the misfit a minimum for about each half wavelength of optical thickness: where
      nothing is known, use starts less than a quarter of a wavelength in the layer apart.
    - `steps`: most evaluations for each start.

    **Returns:** `Solution`: values, deviance, converged and steps of each start.

    **Raises:** ValueError for starts of another shape.

    ```python
    >>> film = pl.Scene(pl.Layer("SiO2", pl.Free(100, 1000)), "Si")
    >>> spectrum = pl.simulate(pl.Scene(pl.Layer("SiO2", 500.0), "Si"), noise=0.002)
    >>> problem = pl.fitting.prepare(spectrum, film)
    >>> noise = 0.002 * jax.random.normal(jax.random.key(1), (20, len(spectrum)))
    >>> solve = jax.jit(jax.vmap(lambda values: pl.fitting.solve(problem.with_data(values), [[490.0]])))
    >>> values = solve(spectrum.values + noise).values
    >>> values.shape, float(values.mean().round()), bool(0.01 < values.std() < 0.05)
    ((20, 1, 1), 500.0, True)

    ```
    """
    box = problem._box
    starts = jnp.asarray(starts)
    if starts.ndim != 2 or starts.shape[1] != len(problem.names):
        raise ValueError(
            f"`starts`: expected (starts, parameters) with {len(problem.names)} parameters"
            f" ({', '.join(problem.names)}), got {starts.shape}"
        )
    units = jnp.clip((starts - box.lower) / (box.upper - box.lower), 0.0, 1.0)
    lower, upper = (jnp.broadcast_to(side, starts.shape) for side in (box.lower, box.upper))
    until = Until(len(starts), steps, 0.0, 0.0)
    static = (Member(problem._static, len(problem.names)),), min(len(starts), MOST)
    minimum = polished(static, problem._arrays, box._replace(lower=lower, upper=upper), units, until)
    values = problem._static[0].values(box, minimum.units)
    return Solution(values, minimum.deviance, minimum.converged, minimum.steps)
