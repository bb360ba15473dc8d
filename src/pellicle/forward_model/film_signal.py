"""Forward model of a film: composes the effects of a plan into a function of a scene.

Each average over the bandwidth, a thickness spread or a cone of light wraps a forward model and averages rows
of intensities, never amplitudes or ratios. Errors of the quadrature rules are in
`pellicle.optics.quadrature`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Tabulated
from pellicle.errors import UsageError
from pellicle.forward_model import mixed_polarisations
from pellicle.forward_model.coherent_groups import CoherentGroup, coherent_groups, powers, responses_of
from pellicle.forward_model.plan import GENERAL, Plan
from pellicle.materials import Material, check_common_range
from pellicle.optics import ellipsometry, plate
from pellicle.optics.coherent import FEW
from pellicle.optics.hoisting import pointwise, stack_rows
from pellicle.optics.orders import FWHM
from pellicle.optics.pair import map_rows, namespace
from pellicle.optics.quadrature import Turn, cone_rays, lens_rays, normal_rule
from pellicle.scene.film import Scene, media, of_reference, thickness_spread, turned, unchecked
from pellicle.scene.free import Content, free_leaves
from pellicle.scene.layers import Interface, Layer

Intensities = Callable[[Scene], Any]
"""A scene in numbers → rows of intensities, each (wavelengths,)."""


def _mean_over(weights: Any, at: Callable[..., list[Any]], *nodes: Any) -> list[Any]:
    """Σ weights · row of the rows at each of the nodes, (nodes, ...)."""
    if namespace(weights) is not np:
        return [jnp.tensordot(weights, row, 1) for row in jax.vmap(at)(*nodes)]
    each = [at(*node) for node in zip(*nodes, strict=True)]
    return [sum(w * row for w, row in zip(weights, rows, strict=True)) for rows in zip(*each, strict=True)]


def over_normal(
    simulate: Intensities, count: int, shifted: Callable[[Scene, Any], tuple[Callable[[Any], Any], Any]]
) -> Intensities:
    """The mean over a normal distribution of one number of a scene.

    `shifted(scene, node)` is where that number is, and its value `node` standard deviations from its own.
    """
    nodes, weights = normal_rule(count)

    def average(scene: Scene):
        like = jnp.result_type(scene.light.wavelength)

        def at(node):
            where, value = shifted(scene, node)
            return simulate(eqx.tree_at(where, scene, value))

        xp = namespace(scene)
        return _mean_over(xp.asarray(weights, like), at, xp.asarray(nodes, like))

    return average


def _of_bandwidth(scene: Scene, node: Any) -> tuple[Callable[[Any], Any], Any]:
    """A wavelength in the window of the spectrometer, whose FWHM is the bandwidth."""
    bandwidth: Any = scene.instrument.bandwidth
    return lambda s: s.light.wavelength, scene.light.wavelength + node * (bandwidth / FWHM)


def _of_thickness(position: int, scene: Scene, node: Any) -> tuple[Callable[[Any], Any], Any]:
    """A thickness within the spread of one layer, 0 at least."""
    layer: Any = scene.layers[position]
    uneven = layer.thickness + node * thickness_spread(scene, layer)
    uneven = namespace(uneven).maximum(uneven, 0.0)
    return lambda s: s.layers[position].thickness, uneven


def cone_sine(scene: Scene) -> Any:
    """The sine of the half angle of the cone; one for each wavelength if the ambient is dispersive."""
    aperture, spread = scene.instrument.numerical_aperture, scene.instrument.angle_spread
    if aperture is not None:
        return aperture / scene.ambient.index(scene.light.wavelength)
    xp: Any = namespace(spread)
    return xp.sin(xp.deg2rad(spread))


def over_cone(
    simulate: Intensities, count: int, around: int, mix: Callable[[Any, Any, Any], Any]
) -> Intensities:
    """The mean over the cone of light; `mix(rows, cosine, square)` turns s and p of a ray: see `ConeRays`."""

    def average(scene: Scene):
        like = jnp.result_type(scene.light.wavelength)
        pupil = cone_sine(scene), count, around, scene.instrument.apodisation
        xp = namespace(scene)
        rays = cone_rays(namespace(scene.light.angle).deg2rad(scene.light.angle), *pupil)

        def at(angle, cosine, square):
            inclined = eqx.tree_at(lambda s: s.light.angle, scene, namespace(angle).rad2deg(angle))
            return mix(simulate(inclined), cosine, square)

        turns = (xp.broadcast_to(xp.asarray(x, like), rays.angle.shape) for x in (rays.cosine, rays.square))
        return _mean_over(xp.asarray(rays.weight, like), at, xp.asarray(rays.angle, like), *turns)

    return average


def over_lens(of_ray: Callable[[Turn], Intensities], count: int, around: int) -> Intensities:
    """The mean over the cone of light where s and p mix; `of_ray(turn)` are the intensities of a ray.

    The rays of a ring are along a first axis of arrays, in front of the wavelengths. Rings are computed one
    after the other: together they may need gigabytes.
    """

    def average(scene: Scene):
        like = jnp.result_type(scene.light.wavelength)
        pupil = cone_sine(scene), count, around, scene.instrument.apodisation
        xp: Any = namespace(scene)
        rays = lens_rays(xp.deg2rad(scene.light.angle), *pupil)

        def of_ring(ring: Any):
            angle, azimuth, *turn = ring
            inclined = eqx.tree_at(lambda s: s.light.angle, scene, xp.rad2deg(angle))
            rows = of_ray(Turn(*turn))(turned(inclined, against=xp.rad2deg(azimuth)))
            return [row.mean(axis=0) for row in rows]

        # one axis of wavelengths behind that of the rays
        numbers = (rays.angle, rays.azimuth, *rays.turn)
        rings = [xp.asarray(x, like).reshape(count, around, -1) for x in numbers]
        weights = xp.asarray(rays.weight, like).reshape(count, around).sum(axis=1)
        return [xp.tensordot(weights, row, 1) for row in map_rows(of_ring, rings)]

    return average


def mixed_powers(polarisation: str, rows: Any, cosine: Any, square: Any) -> list[Any]:
    """Weighted sum of s and p of a ray: one half each for unpolarised light, else by the lens's rotation."""
    half = {"s": 0.5, "p": -0.5, "unpolarised": 0.0}[polarisation] * cosine
    return [(0.5 + half) * rows[0] + (0.5 - half) * rows[1]]


def turned_stokes(rows: Any, cosine: Any, square: Any) -> Any:
    """The Stokes sums (n, c, s, intensity) of a ray in the frame of the axis, then its m22 and m44.

    The lens before the sample turns s and p of a ray by ψ against those of its plane of incidence, and the
    lens behind it, its mirror image, by ψ again: the Jones matrix is R(ψ) diag(r_p, r_s) R(ψ). Elements of
    its Mueller matrix that are odd in ψ cancel between mirror images of a ray. With n = |r_s|² − |r_p|²,
    c + is = 2 conj(r_p) r_s and I = |r_s|² + |r_p|² the others are m12 = m21 = −n cos 2ψ,
    m22 = I cos² 2ψ − c sin² 2ψ, m33 = c cos² 2ψ − I sin² 2ψ, m44 = c and m34 = −m43 = s cos 2ψ.
    """
    n, c, s, intensity = rows
    sine = 1 - square
    c_turned, m22 = c * square - intensity * sine, intensity * square - c * sine
    return [n * cosine, c_turned, s * cosine, intensity, m22, c]


Simulate = Callable[[Scene], Any]


def tabulated(scene: Scene, slope: bool | None = None) -> Scene:
    """The scene with every medium evaluated at the wavelengths of its light.

    Of a medium with free parameters, the materials in it are evaluated. A fit then compiles one program for
    all materials, and evaluates each once. `slope` includes the derivative in wavelength, with which the
    index goes on where a shift of the wavelengths leaves the range of a table; by default where the scene has
    a bandwidth or such a shift.

    **Raises:** ValueError where a material has no data, naming it and the wavelengths.
    """
    wavelength, instrument = np.asarray(scene.light.wavelength, dtype=float), scene.instrument
    if slope is None:
        slope = instrument.bandwidth is not None or instrument.wavelength_shift is not None
    if (reference := scene.reference) is not None:
        known = tabulated(of_reference(scene), slope)
        # each medium of it, which leaves ties to the sample
        pairs: Any = zip(reference.layers, known.layers, strict=False)
        layers = [x if isinstance(x, Interface) else replace(x, material=y.material) for x, y in pairs]
        substrate = replace(reference.substrate, material=known.substrate.material)
        scene = replace(scene, reference=unchecked(reference, substrate=substrate, layers=tuple(layers)))
    check_common_range(media(scene), wavelength)
    # equal media of many layers are one object, which a program has once; few layers of any media share one
    keys = [Content(m) if len(scene.layers) > FEW else i for i, m in enumerate(media(scene))]
    pairs = dict(zip(keys, media(scene), strict=True)).items()
    known = {key: _tabulated(medium, wavelength, slope) for key, medium in pairs}
    return eqx.tree_at(media, scene, [known[key] for key in keys])


def _tabulated(dispersion: AbstractDispersion, wavelength: np.ndarray, slope: bool) -> AbstractDispersion:
    if free_leaves(dispersion):

        def known(part: Any) -> bool:
            return isinstance(part, Material) and not free_leaves(part)

        evaluated = lambda part: _tabulated(part, wavelength, slope) if known(part) else part  # noqa: E731
        return jax.tree.map(evaluated, dispersion, is_leaf=known)
    if not slope:
        return Tabulated(wavelength, known_index(dispersion, wavelength), None)
    return Tabulated(wavelength, *jax.device_get(_index_and_slope(dispersion, wavelength)))


@jax.jit
def _index_and_slope(dispersion: AbstractDispersion, wavelength):
    return jax.jvp(dispersion.index, (wavelength,), (jnp.ones_like(wavelength),))


@lru_cache(maxsize=64)
def build(plan: Plan) -> Simulate:
    """The forward model of a plan: simulate(scene) → signal at `scene.light.wavelength`.

    The signal is a fraction, without scale or offset; for ellipsometry it is one array with N, C, S of the
    first wavelength, then of the next, or with the other rows of its kind of signal. `scene` contains numbers
    only (see `scene.free.insert`). The function is pure and can be traced.
    """
    kind, each = plan.kind, signal_rows(plan)

    def simulate(scene: Scene) -> Any:
        signal = each(scene)
        return stack_rows(signal).T.reshape(-1) if kind.ellipsometric else kind.of_power(signal[0])

    return simulate if plan.reference is None else _against(simulate, build(plan.reference))


def signal_rows(plan: Plan) -> Callable[[Scene], Sequence[Any]]:
    """The rows (..., wavelengths) of the signal of a scene, without the reference of a contrast."""
    kind, ellipsometric = plan.kind, plan.kind.ellipsometric
    rows = partial(_stokes_rows if ellipsometric else _power_rows, plan)
    finish = _normalised_rows if ellipsometric else _mean
    mixed = plan.row("anisotropy").count >= GENERAL
    if mixed:
        rows, finish = partial(mixed_polarisations.rows, plan), kind.of_sums
    averaged = plan.row("coherence").count or plan.on("angle-spread")

    def at_each_wavelength(groups: list[CoherentGroup], **turn: Any) -> Sequence[Any]:
        return list(rows(groups, **turn)) if averaged else finish(rows(groups))

    def monochromatic(scene: Scene, /, **turn: Any) -> Any:
        groups = coherent_groups(plan, scene)
        # slices have an axis of their own, along which nothing acts element by element; a program of the 4×4
        # method with its slopes in each number one by one takes a minute to compile
        if plan.on("gradient") or mixed or birefringent_on_plates(plan):
            return at_each_wavelength(groups, **turn)
        return pointwise(at_each_wavelength, groups)

    def of_ray(turn: Turn | None = None) -> Intensities:
        one: Intensities = monochromatic if turn is None else partial(monochromatic, turn=turn)
        count = plan.row("coherence").count
        return _averaged(one, count) if count else one

    intensities, cone = of_ray(), plan.row("angle-spread")
    if cone.on and mixed:
        intensities = over_lens(of_ray, cone.count, cone.around)
    elif cone.on:
        mix = turned_stokes if ellipsometric else partial(mixed_powers, plan.polarisation)
        intensities = over_cone(intensities, cone.count, cone.around, mix)

    def simulate(scene: Scene) -> Sequence[Any]:
        scene = turned(_shifted(scene))
        for remove in plan.left_out:
            scene = remove(scene)
        signal = finish(intensities(scene)) if averaged else intensities(scene)
        # behind the averages, whose slopes then have three rows
        return kind.isotropic(signal) if ellipsometric and not mixed else signal

    return simulate


def _against(simulate: Simulate, reference: Simulate) -> Simulate:
    """The contrast of a scene against its reference, with the stray light of both."""

    def contrast(scene: Scene) -> Any:
        powers, stray = (simulate(scene), reference(of_reference(scene))), scene.instrument.stray_light
        seen = powers if stray is None else (power + stray for power in powers)
        return scene.light.kind.seen_in(scene, False).against(*seen)

    return contrast


def depolarises(plan: Plan) -> bool:
    """True where intensities of several polarisations add, so that some light is unpolarised.

    (N, C, S) of `build` is then shorter than 1: the depolarisation is 1 − N² − C² − S².
    """
    return plan.on("back-face") or plan.on("angle-spread") or bool(plan.row("coherence").count)


def _shifted(scene: Scene) -> Scene:
    """The scene at its true wavelengths and angles, where the instrument's are shifted.

    A tabulated medium follows to first order, which is enough for the few nm of a calibration.
    """
    nm, degrees = scene.instrument.wavelength_shift, scene.instrument.angle_shift
    if nm is not None:
        scene = eqx.tree_at(lambda s: s.light.wavelength, scene, scene.light.wavelength + nm)
    if degrees is not None:
        scene = eqx.tree_at(lambda s: s.light.angle, scene, scene.light.angle + degrees)
    return scene


def _averaged(intensities: Intensities, count: int) -> Intensities:
    """Intensities averaged over the thickness spreads and the bandwidth of a scene."""

    def average(scene: Scene):
        averaged = intensities
        for position, layer in enumerate(scene.layers):
            if isinstance(layer, Layer) and thickness_spread(scene, layer) is not None:
                averaged = over_normal(averaged, count, partial(_of_thickness, position))
        if scene.instrument.bandwidth is not None:
            averaged = over_normal(averaged, count, _of_bandwidth)
        return averaged(scene)

    return average


def _mean(rows: Sequence[Any]) -> Sequence[Any]:
    """The mean over polarisations."""
    return rows if len(rows) == 1 else [0.5 * (rows[0] + rows[1])]


def _normalised_rows(rows: Sequence[Any]) -> Sequence[Any]:
    """N, C and S; behind a cone of light also m22 and m44 of the Mueller matrix."""
    n, c, s, intensity, *others = rows
    ratios = ellipsometry.normalised(ellipsometry.Stokes(n, c, s, intensity))
    if not others:
        return ratios
    m22, m44 = others
    return [*ratios, *ellipsometry.normalised(ellipsometry.Stokes(n, m22, m44, intensity))[1:]]


def _power_rows(plan: Plan, groups: list[CoherentGroup]) -> list[Any]:
    """R or T of one polarisation, or of both."""
    polarisations = "sp"
    if not plan.on("polarisation"):
        one = (plan.on("oblique") or plan.on("anisotropy")) and plan.polarisation != "unpolarised"
        polarisations = plan.polarisation if one else "s"
    return powers(plan, groups, polarisations, plan.kind.transmitted)


def _stokes_rows(plan: Plan, groups: list[CoherentGroup]) -> ellipsometry.Stokes:
    """Stokes parameters before normalisation."""
    through = plan.kind.transmitted
    if len(groups) == 1:
        s, p = responses_of(plan, groups[0], "sp")
        return ellipsometry.transmitted_stokes(s, p) if through else ellipsometry.stokes(s, p)
    if birefringent_on_plates(plan):
        if through:
            raise UsageError(mixed_polarisations.NO_PLATE)
        return mixed_polarisations.stokes(plan, groups)
    s, p = powers(plan, groups, "sp", through)
    return ellipsometry.stokes_from_sums(s, p, _cross_product(plan, groups, through))


def birefringent_on_plates(plan: Plan) -> bool:
    """True where s and p may cross the layers with different phases that the 2×2 method leaves out.

    Its amplitudes have a scale, which is real and the same for s and p in one layer without losses.
    """
    scaled = plan.on("absorption") or plan.on("tunnelling") or plan.on("stack")
    return plan.on("anisotropy") and plan.on("back-face") and plan.ellipsometric and scaled


def _cross_product(plan: Plan, groups: list[CoherentGroup], through: bool) -> Any:
    """conj(r_p) r_s of the first group and everything below it, or conj(t_p) t_s through them."""
    group, *below = groups
    front = ellipsometry.cross_products(*responses_of(plan, group, "sp"))
    if not below:
        return front.passed if through else front.reflected
    medium, back = (group.internal, group.collected), _cross_product(plan, below, False)
    if not through:
        return plate.multiple_reflections(front.reflected, front.passed_twice, front.below, back, *medium)
    face = plate.Face(front.reflected, front.passed, front.below)
    return plate.plate_transmittance(face, back, _cross_product(plan, below, True), *medium)
