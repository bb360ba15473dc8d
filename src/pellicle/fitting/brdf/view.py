"""BRDF samples as a view of a least-squares problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import direction
from pellicle.brdf.lobes import Evaluate, two_lobes
from pellicle.brdf.models import model
from pellicle.data.brdf_samples import DARKEST, BrdfSamples
from pellicle.effects.surface_plan import evaluation, exact
from pellicle.fitting.coordinates import Array
from pellicle.fitting.noise import correlation_length
from pellicle.fitting.problem import Blocks, Explained, Noise, NoiseGroup
from pellicle.forward_model.plan import Plan
from pellicle.forward_model.surface_signal import build
from pellicle.optics.pair import namespace
from pellicle.programs.cache import kept
from pellicle.scene.surface import SurfaceView

BLOCK = 150
"""Samples are padded to a multiple of this, so that files of nearly one length share a program, and a search
looks at so many. A polish evaluates them in blocks of this size: one program serves few samples and all."""

PLAIN_WEIGHTS = ("lobe_1", "lobe_2", "diffuse")
"""Weights of two lobes without a layer."""


class Samples(NamedTuple):
    """Samples in numbers, padded: `weight` is 0 on the padding."""

    i: Array  # unit vectors to the light and to the eye, (samples, 3)
    o: Array
    values: Array  # (samples, channels), 1/sr
    weight: Array  # of the transformed residual, (samples, channels)
    floor: Array  # 1/sr, (samples, 1)
    independent_fraction: Array | np.floating = np.float64(1.0)  # effective points per point
    blocks: Array | np.integer = np.int64(1)  # of `BLOCK` samples; those after them have no weight

    def first_block(self) -> Samples:
        """The first `BLOCK` samples."""
        if len(self.values) <= BLOCK:
            return self
        return self._replace(**{name: getattr(self, name)[:BLOCK] for name in self._fields[:5]})


Arrays = tuple[Samples, dict[str, Any]]
"""The samples and the fixed numbers of the surface, by key."""


@dataclass(frozen=True)
class SamplesForm:
    """A BRDF model and which of its numbers are free.

    `kind` is "layer", simulated by the `plan`; "incoherent", the same without interference; or "two lobes",
    without a layer. `keys` and `channels` name each free number; `residual` what is compared.
    """

    model: str
    kind: str
    plan: Plan
    keys: tuple[str, ...]
    channels: tuple[int | None, ...]
    residual: str

    @property
    def nonlinear(self) -> int:
        """Number of free numbers before the weights of lobes, which come last."""
        own = [p.key for p in model(self.model).parameters if p.linear]
        weights = PLAIN_WEIGHTS if self.kind == "two lobes" else own
        return sum(key not in weights for key in self.keys)

    @property
    def evaluate(self) -> Evaluate:
        """(numbers, i, o) → (samples, channels) in 1/sr."""
        if self.kind == "two lobes":
            return two_lobes
        if self.kind == "incoherent":
            return model(self.model).incoherent
        simulate = build(self.plan)
        return lambda numbers, i, o: simulate(SurfaceView(self.model, dict(numbers), i, o))

    def numbers(self, values: Any, fixed: dict[str, Any]) -> dict[str, Any]:
        """Every number of the model by key, those of channels in one array."""
        free: dict[str, Any] = {}
        for value, key, channel in zip(values, self.keys, self.channels, strict=True):
            free[key] = value if channel is None else [*free.get(key, []), value]
        return {**fixed, **{key: jnp.stack(x) if isinstance(x, list) else x for key, x in free.items()}}

    def compare(self, samples: Samples, rho: Any) -> Any:
        """Weighted residuals (samples, channels) of a BRDF's values: measured less computed."""
        transform, about = RESIDUALS[self.residual], (samples.i[:, 2:3], samples.floor)
        difference = transform(samples.values, *about) - transform(rho, *about)
        return namespace(difference).where(samples.weight > 0, difference, 0.0) * samples.weight

    def explain(self, arrays: Arrays, values: Any, /) -> Explained:
        """The samples with the free numbers of the surface at `values`."""
        samples, fixed = arrays
        rho = self.evaluate(self.numbers(values, fixed), samples.i, samples.o)
        residual = self.compare(samples, rho).reshape(-1) * jnp.sqrt(samples.independent_fraction)
        return Explained(rho, residual, jnp.sum(residual**2))

    def blocks(self, arrays: Arrays, /) -> Blocks:
        """The samples, `BLOCK` at a time."""
        samples, fixed = arrays

        def at(k):
            columns = (jax.lax.dynamic_slice_in_dim(x, k * BLOCK, BLOCK) for x in samples[:5])
            return samples._replace(**dict(zip(Samples._fields, columns, strict=False))), fixed

        return Blocks(samples.blocks, at)


class Local(NamedTuple):
    """The BRDF (samples, channels), weighted residuals, and the slope of the compared numbers, weighted, by
    each free number in its own unit: (samples, channels, numbers)."""

    model: Array
    residual: Array
    slope: Array


@kept
def local(form: SamplesForm, samples: Samples, fixed: dict[str, Any], values: Any) -> Local:
    """The model around `values` (free numbers,)."""

    def compared(values):
        rho = form.evaluate(form.numbers(values, fixed), samples.i, samples.o)
        return form.compare(samples, rho), rho

    (residual, rho), push = jax.linearize(compared, values)
    rise, _ = jax.vmap(push, out_axes=-1)(jnp.eye(len(values)))
    return Local(rho, residual, -rise)


@dataclass(frozen=True)
class SamplesView:
    """BRDF samples of a problem; `stated` are the weights before any reweighting."""

    name: str  # empty where there is no other
    plan: Plan
    form: SamplesForm
    data: Samples
    fixed: dict[str, Any]
    takes: tuple[int, ...]
    noise: Noise
    rows: int
    stated: np.ndarray
    relative: tuple[float, ...] | None = None  # see `BrdfSamples`

    @property
    def arrays(self) -> Arrays:
        return self.data, self.fixed

    @property
    def channels(self) -> int:
        """Measured numbers of each sample."""
        return self.data.values.shape[1]

    @property
    def independent(self) -> int:
        """Measured numbers: samples times channels."""
        return self.rows * self.channels

    @property
    def noise_groups(self) -> tuple[NoiseGroup, ...]:
        """One group of all channels."""
        return (NoiseGroup(tuple(range(self.channels)), self.noise.known, self.independent),)

    @property
    def independent_fraction(self) -> Any:
        """Effective points per point (...): correlated errors count less."""
        return self.data.independent_fraction

    def local(self, values: Any) -> Local:
        """The model around `values` (free numbers,)."""
        return local(self.form, self.data, self.fixed, values)

    def residuals(self, at: Local) -> np.ndarray:
        """Weighted residuals (rows, channels)."""
        return np.asarray(at.residual)[: self.rows]

    def at_model(self, at: Local) -> Any:
        """Weights of a relative noise of the model's values over those of the measured ones (rows, channels).

        With the noise of measured values the darker of two equal samples counts more: at 5 % a fit is 0.5 %
        too dark.
        """
        if self.relative is None:
            return 1.0
        samples, slope = self.data, SLOPES[self.form.residual]
        pair = (np.maximum(rho, samples.floor) for rho in (samples.values, np.asarray(at.model)))
        measured, computed = (slope(x, samples.i[:, 2:3], samples.floor) * x for x in pair)
        ratio = measured / computed
        return np.where(np.array(self.relative) > 0, ratio, 1.0)[: self.rows]

    def by_local_noise(self, values: Any) -> SamplesView:
        """The view itself: its points are not neighbours along a spectrum."""
        return self

    def jacobian(self, at: Local) -> np.ndarray:
        """Weighted ∂ compared number / ∂ free number, (rows · channels, free numbers)."""
        return np.asarray(at.slope)[: self.rows].reshape(self.independent, -1)

    def nuisances(self, at: Local) -> list[Any]:
        """None: the weights of lobes are free numbers."""
        return []

    def nuisance_freedom(self, at: Local) -> float:
        """0: there are no nuisances."""
        return 0.0

    def correlation_length(self, residuals: np.ndarray) -> float:
        """Number of neighbouring samples of the file, as on a goniometer's arc, that count as one."""
        return float(np.mean([correlation_length(column) for column in residuals.T]))

    def reweighted(self, factor: Any, fraction: float) -> SamplesView:
        """Weights times `factor` (a number, (channels,) or (rows, channels)), each point for `fraction` of
        one."""
        weight = np.array(self.data.weight)
        weight[: self.rows] *= factor
        return replace(self, data=self.data._replace(weight=weight)).counting(fraction)

    def counting(self, fraction: Any) -> SamplesView:
        """The view with each point counting for `fraction` (...) of an independent one."""
        return replace(self, data=self.data._replace(independent_fraction=np.asarray(fraction, float)[()]))

    def restricted(self, rows: np.ndarray) -> SamplesView:
        """View of the same program with weight on the samples of these rows alone."""
        kept_rows = np.zeros((len(self.data.weight), 1))
        kept_rows[rows] = 1.0
        return replace(self, data=self.data._replace(weight=self.data.weight * kept_rows))

    def thinned(self) -> SamplesView:
        """The view as it is: a look around a minimum needs all samples."""
        return self

    def off_tolerance(self, values: np.ndarray) -> float:
        """Relative error of the view's plan at `values`, as in `effects.surface_plan`."""
        if not self.plan.tolerance:
            return 0.0
        numbers = {key: np.asarray(x) for key, x in self.form.numbers(values, self.fixed).items()}
        i, o = (x[: self.rows] for x in self.data[:2])
        view = SurfaceView(self.form.model, numbers, i, o)
        values_of = evaluation(view).signals
        return float(np.max(np.abs(values_of(self.plan) - values_of(exact(view)))))

    def unit(self) -> np.ndarray:
        """Weights (rows, channels) over those before any reweighting."""
        return np.asarray(self.data.weight)[: self.rows] / self.stated[: self.rows]

    def compared(self, at: Local) -> np.ndarray:
        """Residuals (rows, channels) in the unit of the residual; in standard deviations where σ is given."""
        weight = np.asarray(self.data.weight)[: self.rows]
        scale = np.divide(self.stated[: self.rows], weight, out=np.zeros_like(weight), where=weight > 0)
        return self.residuals(at) * scale

    def slope_of_compared(self, at: Local) -> np.ndarray:
        """Weighted ∂ compared number / ∂ BRDF (rows, channels) at the model."""
        samples = self.data
        rise = SLOPES[self.form.residual](np.asarray(at.model), samples.i[:, 2:3], samples.floor)
        return (rise * samples.weight)[: self.rows]

    def rms(self, at: Local) -> float:
        """rms of the residuals, in the unit of the residual; in standard deviations where σ is given."""
        return float(np.sqrt(np.mean(self.compared(at) ** 2)))

    def span(self) -> float:
        """The range of the compared data, in the residuals' unit."""
        stated = self.data._replace(weight=self.stated)
        values = self.form.compare(stated, 0.0 * self.data.values)[: self.rows]
        return float(np.max(np.ptp(values, axis=0)))


def samples_view(
    samples: BrdfSamples, name: str, plan: Plan, form: SamplesForm, fixed: dict[str, Any]
) -> SamplesView:
    """The view of a file's samples; weights are 1/σ where σ is known, else 1 for every transformed value."""
    size, known = len(samples), samples.values
    extra = -size % BLOCK

    def pad(x: Array, edge: Any) -> np.ndarray:
        return np.concatenate([x, np.broadcast_to(edge, (extra, *np.shape(x)[1:]))])

    i = direction(samples.theta_i, samples.phi_i, np)
    o = direction(samples.theta_o, samples.phi_o, np)
    floor = np.full((size + extra, 1), DARKEST * max(float(np.median(known)), 1e-9))
    weight = np.ones_like(known)
    if samples.sigma is not None:
        weight = 1 / (SLOPES[form.residual](known, i[:, 2:3], floor[:size]) * samples.sigma)
    up, weight = np.array([0.0, 0.0, 1.0]), pad(weight, 0.0)
    columns = pad(i, up), pad(o, up), pad(known, np.median(known)), weight, floor
    numbers = Samples(*columns, blocks=np.int64(len(weight) // BLOCK))
    # weights that suit the eye are not those of the noise, which grows with the signal
    noise = Noise(given=samples.sigma is not None, correlated=True, uneven=samples.sigma is None)
    takes, relative = tuple(range(len(form.keys))), samples.relative
    return SamplesView(name, plan, form, numbers, fixed, takes, noise, size, weight, relative)


Transform = Callable[[Any, Any, Any], Any]
"""(ρ, cos θ_i, floor) → the number that is compared; `floor` (1/sr) keeps slopes finite at ρ = 0."""

RESIDUALS: dict[str, Transform] = {
    "linear": lambda rho, cosine, floor: rho,
    "cosine": lambda rho, cosine, floor: rho * cosine,
    "log": lambda rho, cosine, floor: namespace(rho).log1p(rho * cosine),
    "cube-root": lambda rho, cosine, floor: namespace(rho).cbrt(rho + floor),
}

SLOPES: dict[str, Transform] = {
    "linear": lambda rho, cosine, floor: namespace(rho).ones_like(rho),
    "cosine": lambda rho, cosine, floor: namespace(rho).ones_like(rho) * cosine,
    "log": lambda rho, cosine, floor: cosine / (1 + rho * cosine),
    "cube-root": lambda rho, cosine, floor: 1 / (3 * namespace(rho).cbrt(rho + floor) ** 2),
}
"""d `RESIDUALS`/dρ."""

INVERSES: dict[str, Transform] = {
    "linear": lambda compared, cosine, floor: compared,
    "cosine": lambda compared, cosine, floor: compared / cosine,
    "log": lambda compared, cosine, floor: jnp.expm1(compared) / cosine,
    "cube-root": lambda compared, cosine, floor: compared**3 - floor,
}
"""(number that is compared, cos θ_i, floor) → ρ."""
