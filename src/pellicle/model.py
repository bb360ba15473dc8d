"""From a plan to a function that predicts the signal: it composes what the plan names, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.materials import materials_in
from pellicle.optics import ellipsometry, film, interface, orders, plate, stack
from pellicle.optics.dispersion import AbstractDispersion, Sampled
from pellicle.optics.number import Number, imag, real, sincos_poly
from pellicle.planning import Plan
from pellicle.scene import Layer, Scene, free_leaves

Simulate = Callable[[Scene], Any]


@jax.jit
def _index_and_slope(dispersion: AbstractDispersion, wavelength):
    return jax.jvp(dispersion.index, (wavelength,), (jnp.ones_like(wavelength),))


def sample(dispersion: AbstractDispersion, wavelength: np.ndarray, slope: bool = True) -> AbstractDispersion:
    """The dispersion at these wavelengths (nm), evaluated once; one with free parameters is kept.

    Raises ValueError where a material has no data, naming it and the wavelengths.
    """
    for material in materials_in(dispersion):
        material.check_range(wavelength)
    if free_leaves(dispersion):
        return dispersion
    index, rate = jax.device_get(_index_and_slope(dispersion, wavelength))
    return Sampled(wavelength, index, rate if slope else None)


def sampled(scene: Scene, slope: bool = True) -> Scene:
    """The scene with every medium that has no free parameter evaluated at the light's wavelengths.

    A fit then compiles one program for all tables, and evaluates them once.
    """
    wavelength = np.asarray(scene.light.wavelength, dtype=float)

    def media(s: Scene) -> list[AbstractDispersion]:
        back = [] if s.substrate.back is None else [s.substrate.back]
        return [*(layer.material for layer in s.layers), s.substrate.material, s.ambient, *back]

    return eqx.tree_at(media, scene, [sample(m, wavelength, slope) for m in media(scene)])


@lru_cache(maxsize=64)
def build(plan: Plan) -> Simulate:
    """simulate(scene) → the signal at `scene.light.wavelength`, as a fraction, without scale or offset.

    For ellipsometry it is N, C, S of the first wavelength, then of the next, in one array. `scene`
    holds numbers only (see `scene.insert`). The function is pure and can be traced.
    """
    simulate = _ellipsometer(plan) if plan.signal == "psi-delta" else _photometer(plan)
    averaged = _averaged(simulate, plan.row("orders").count) if plan.quadrature else simulate
    return _on_sphere(averaged) if plan.signal == "psi-delta" else averaged


def _photometer(plan: Plan) -> Simulate:
    faces = _windowed_faces if plan.on("coherence") and not plan.quadrature else _coherent_faces
    finish = _with_back if plan.on("back-face") else _half_space

    def simulate(scene: Scene):
        optics = _Optics(plan, scene)
        signals = [finish(plan, optics, p, faces(plan, optics, p)) for p in _polarisations(plan)]
        return signals[0] if len(signals) == 1 else 0.5 * (signals[0] + signals[1])

    return simulate


def _ellipsometer(plan: Plan) -> Simulate:
    """Sums of intensities, (4, wavelengths): what a bandwidth averages."""

    def simulate(scene: Scene):
        optics = _Optics(plan, scene)
        return jnp.stack(ellipsometry.stokes(_wave(plan, optics, "s"), _wave(plan, optics, "p")))

    return simulate


def _on_sphere(simulate: Simulate) -> Simulate:
    def point(scene: Scene):
        return jnp.stack(ellipsometry.normalised(ellipsometry.Stokes(*simulate(scene))), -1).reshape(-1)

    return point


def _averaged(simulate: Simulate, count: int) -> Simulate:
    """The same over the spectrometer's bandwidth, by Gauss-Hermite quadrature in wavelength."""
    nodes, weights = np.polynomial.hermite.hermgauss(count)

    def average(scene: Scene):
        bandwidth: Any = scene.instrument.bandwidth
        width = bandwidth / orders.FWHM * np.sqrt(2)

        def at(node):
            shifted = scene.light.wavelength + node * width
            return simulate(eqx.tree_at(lambda s: s.light.wavelength, scene, shifted))

        return jnp.tensordot(jnp.asarray(weights / np.sqrt(np.pi)), jax.vmap(at)(jnp.asarray(nodes)), 1)

    return average


def _polarisations(plan: Plan) -> str:
    if plan.on("polarisation"):
        return "sp"
    return plan.polarisation if plan.on("oblique") and plan.polarisation != "unpolarised" else "s"


class _Optics:
    """The indices at each wavelength, in the number types that the plan allows."""

    def __init__(self, plan: Plan, scene: Scene):
        self.scene, self.wavelength = scene, scene.light.wavelength
        self.angle = jnp.deg2rad(scene.light.angle) if plan.on("oblique") else None
        self.ambient = scene.ambient.index(self.wavelength)
        self.layers = [self.layer_at(plan, layer, self.wavelength) for layer in scene.layers]
        free_root = interface.allow_tunnelling if plan.on("tunnelling") else _unchanged
        self.substrate = free_root(scene.substrate.material.index(self.wavelength))
        self.phases = [2 * jnp.pi / self.wavelength * layer.thickness for layer in scene.layers]

    def layer_at(self, plan: Plan, layer: Layer, wavelength) -> Number:
        index = layer.material.index(wavelength)
        return index if plan.on("absorption") else real(index)


def _unchanged(index: Number) -> Number:
    return index


def _coherent_faces(plan: Plan, optics: _Optics, polarisation: str) -> dict[str, Any]:
    """Functions that give the layers' power coefficients; one that is not called costs nothing."""
    wave = _wave(plan, optics, polarisation)
    return {
        "R": partial(film.reflectance, wave),
        "T": partial(film.transmittance, wave),
        "below": partial(film.reflectance_below, wave),
    }


def _wave(plan: Plan, optics: _Optics, polarisation: str) -> film.Wave:
    if plan.on("stack"):
        (wave,) = stack.stack(
            optics.ambient,
            optics.layers,
            optics.substrate,
            optics.phases,
            optics.angle,
            polarisation,
            sincos=sincos_poly,
        )
        return wave
    real_wave = not plan.on("absorption") and not plan.on("tunnelling")
    (wave,) = film.film(
        optics.ambient,
        optics.layers[0],
        optics.substrate,
        optics.phases[0],
        optics.angle,
        polarisation,
        through=film.through_wave if real_wave else film.through,
        sincos=sincos_poly,
    )
    return wave


def _windowed_faces(plan: Plan, optics: _Optics, polarisation: str) -> dict[str, Any]:
    """The same, order by order through the instrument's window."""
    layer = interface.allow_tunnelling(optics.layers[0]) if plan.on("tunnelling") else optics.layers[0]
    b = orders.bounces(optics.ambient, layer, optics.substrate, optics.phases[0], optics.angle, polarisation)
    window = orders.gaussian(_blur(plan, optics))
    count = plan.row("orders").count
    back = orders.reversed_bounces(b)
    return {
        "R": lambda: orders.reflectance(b, window, count, sincos_poly),
        "T": lambda: orders.transmittance(b, window, count, sincos_poly),
        "below": lambda: orders.reflectance(back, window, count, sincos_poly),
    }


def _blur(plan: Plan, optics: _Optics):
    """Variance of the phase from the spectrometer's bandwidth and the layer's uneven thickness."""
    scene, instrument = optics.scene, optics.scene.instrument

    def cosine_index(wavelength):
        a, _ = interface.transverse(scene.ambient.index(wavelength), optics.angle)
        layer = optics.layer_at(plan, scene.layers[0], wavelength)
        layer = interface.allow_tunnelling(layer) if plan.on("tunnelling") else layer
        return real(interface.normal(layer, a))

    def phase(wavelength):
        return 4 * jnp.pi / wavelength * cosine_index(wavelength) * scene.layers[0].thickness

    _, slope = jax.jvp(phase, (optics.wavelength,), (jnp.ones_like(optics.wavelength),))
    bandwidth = 0.0 if instrument.bandwidth is None else instrument.bandwidth
    spread = 0.0 if instrument.thickness_spread is None else instrument.thickness_spread
    return orders.blur(slope, bandwidth, cosine_index(optics.wavelength), spread, optics.wavelength)


def _half_space(plan: Plan, optics: _Optics, polarisation: str, faces: dict[str, Any]):
    return faces[plan.signal]()


def _with_back(plan: Plan, optics: _Optics, polarisation: str, faces: dict[str, Any]):
    """The plate under the layer: both faces and what is lost between them."""
    scene, a = optics.scene, interface.transverse(optics.ambient, optics.angle)[0]
    behind: Any = scene.substrate.back  # the plan has seen that there is one
    back = interface.allow_tunnelling(behind.index(optics.wavelength))
    inside, outside = optics.substrate, back
    q_in, q_out = interface.normal(inside, a), interface.normal(outside, a)
    internal = plate.internal_transmittance(imag(q_in), scene.substrate.plate_mm, optics.wavelength)
    reflected = interface.reflectance(inside, q_in, outside, q_out, polarisation)
    front = plate.Face(faces["R"](), faces["T"](), faces["below"]())
    if plan.signal == "R":
        return plate.plate_reflectance(front, reflected, internal)
    passed = interface.transmittance(inside, q_in, outside, q_out, polarisation)
    return plate.plate_transmittance(front, reflected, passed, internal)
