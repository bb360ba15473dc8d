"""Methods of simulating a scene, each of which leaves something out, and their comparison."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, Program, Variant, changed, compiled, disperses, removed, with_effect
from pellicle.accuracy.registry import Comparison, Method, measure
from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.effects.film_plan import plan
from pellicle.effects.removal import FilmRemoval, RealPart
from pellicle.errors import UsageError, install_command
from pellicle.fitting.progress import Progress
from pellicle.forward_model.plan import CLOSED_FORMS, GENERAL
from pellicle.optics.pair import Pair, is_real, parts
from pellicle.scene.film import Scene, all_collected, coherent_layers, media, sliced, with_wavelength
from pellicle.scene.free import is_free, start_values
from pellicle.scene.graded import each_medium
from pellicle.scene.layers import Layer, Plate

Apply = Callable[[Case], Variant | str]


def having(effect: str, absent: str, apply: Apply) -> Apply:
    """A method for scenes with one effect; `absent` is the reason where a scene does not have it."""
    return lambda case: apply(case) if case.plan.on(effect) else absent


def without(effect: str, absent: str) -> Apply:
    """A method that leaves one effect out, otherwise in full, if the signal has a meaning without it."""

    def apply(case: Case) -> Variant | str:
        if effect == "oblique" and case.ellipsometric:
            return "ellipsometry compares s and p, which are equal at normal incidence"
        if effect == "polarisation" and (case.ellipsometric or case.scene.instrument.has_cone):
            return "this signal needs both polarisations"
        if effect == "back-face" and case.plan.signal == "T":
            return "light transmitted by a plate passes its back face"
        return having(effect, absent, partial(removed, FilmRemoval(effect)))(case)

    return apply


def transparent(case: Case) -> Variant | str:
    """Layers without absorption: the real parts of their indices."""
    layers = tuple(
        replace(x, material=each_medium(RealPart, x.material)) if isinstance(x, Layer) else x
        for x in case.scene.layers
    )
    return changed(eqx.tree_at(lambda s: s.layers, case.scene, layers))


@final
class AtOne(AbstractDispersion):
    """Index of another medium at one wavelength (nm), used at all wavelengths."""

    base: AbstractDispersion
    at: float

    def index(self, wavelength):
        one = jnp.ones_like(wavelength)
        index = self.base.index(self.at * one[..., :1] if one.ndim else self.at * one)
        re, im = parts(index)
        return re * one if is_real(index) else Pair(re * one, im * one)


def constant_index(case: Case) -> Variant | str:
    """Every medium with its index at the middle of the spectrum."""
    if not disperses(case):
        return "no index varies over the spectrum"
    middle = float(0.5 * (case.wavelength.min() + case.wavelength.max()))
    flat = [AtOne(m, middle) for m in media(case.scene)]
    return Variant(case.plan, eqx.tree_at(media, case.scene, flat))


def fewer_slices(count: int, case: Case) -> Variant | str:
    """Fewer slices of graded layers than in the full plan."""
    if case.plan.row("gradient").count <= count:
        return f"the full plan has {case.plan.row('gradient').count} slices"
    return Variant(with_effect(case.plan, "gradient", True, count), case.scene)


@dataclass(frozen=True)
class HomogeneousSlices:
    """Replaces every graded layer of a scene by homogeneous slices, as programs without graded layers do."""

    count: int
    effect: str = "gradient"

    def __call__(self, scene: Scene) -> Scene:
        return sliced(scene, self.count)


def aligned_axes(case: Case) -> Variant | str:
    """Every tilted axis at the right angles next to its start values, so that s and p stay apart."""
    if case.plan.row("anisotropy").count < GENERAL:
        return "no optic axis is tilted"
    if case.scene.light.azimuth is not None:
        return "the sample is turned"

    def next_to(angle: Any) -> float:
        return 90.0 * round(float(start_values(angle)[0] if is_free(angle) else angle) / 90)

    return _with_angles(next_to, case)


def general_matrices(case: Case) -> Variant | str:
    """4×4 matrices where the full plan takes the closed forms of aligned axes."""
    if case.plan.row("anisotropy").count != CLOSED_FORMS:
        return "the full plan has them" if case.plan.on("anisotropy") else "no medium is birefringent"
    return _with_angles(np.asarray, case)  # an array is no literal angle


def _with_angles(angle: Callable[[Any], Any], case: Case) -> Variant:
    return changed(
        jax.tree_util.tree_map(
            lambda x: x.with_angles(angle) if isinstance(x, Anisotropic) else x,
            case.scene,
            is_leaf=lambda x: isinstance(x, Anisotropic) or is_free(x),
        )
    )


def _all_collected(case: Case) -> Variant | str:
    """The scene with all light from its back face collected."""
    scene = all_collected(case.scene)
    same = scene.substrate == case.scene.substrate and scene.layers == case.scene.layers
    return "all light from the back face is collected" if same else changed(scene)


def _one_reflection(case: Case) -> Variant | str:
    """The scene with the light of one reflection at its back face."""
    plates = [x for x in case.scene.layers if isinstance(x, Plate)]
    if plates or case.scene.substrate.back_reflections is not None:
        return "reflections are counted at the back of a substrate, where all are collected"
    return changed(replace(case.scene, substrate=replace(case.scene.substrate, back_reflections=1)))


def _damping(case: Case, on: bool, count: int = 0) -> Variant:
    """Fringes damped order by order, or not at all."""
    return Variant(with_effect(with_effect(case.plan, "coherence", on), "orders", on, count), case.scene)


def _orders(count: int, case: Case) -> Variant | str:
    smooth = not case.plan.on("roughness")
    if case.ellipsometric or not smooth or len(coherent_layers(case.scene)) != 1:
        return "only one smooth layer has a series of orders"
    if case.plan.row("anisotropy").count >= GENERAL:
        return "layers in which s and p mix have no series of orders"
    if case.plan.on("orders"):
        return "fringes narrower than the sampling have no orders" if count else "this is the full plan"
    return _damping(case, True, count)


def _nodes(count: int, case: Case) -> Variant | str:
    if case.plan.row("coherence").count <= count:
        return "no average over nodes"
    return Variant(with_effect(case.plan, "coherence", True, count), case.scene)


def _is_rising(case: Case) -> bool:
    """True for one angle of incidence and rising wavelengths."""
    return not np.ndim(case.scene.light.angle) and bool(np.all(np.diff(case.wavelength) > 0))


def _coarser(step: int, case: Case) -> Variant | str:
    """Every `step`-th wavelength and the last, with linear interpolation between them."""
    own = case.wavelength
    if not _is_rising(case) or len(own) < 3 * step:
        return "too few wavelengths to leave any out"
    nodes = np.unique([*own[::step], own[-1]])
    size, left = len(own) - 1, np.arange(len(own) - 1) // step
    share = ((own[:-1] - nodes[left]) / (nodes[left + 1] - nodes[left]))[:, None]

    def finish(signal):
        rows = signal.reshape(len(nodes), -1)
        first, second = (jnp.repeat(x, step, axis=0)[:size] for x in (rows[:-1], rows[1:]))
        return jnp.concatenate([first + (second - first) * share.astype(rows.dtype), rows[-1:]]).reshape(-1)

    return Variant(case.plan, with_wavelength(case.scene, nodes), finish)


def _finer(case: Case) -> Variant | str:
    """One more wavelength between any two, whose signals are then discarded."""
    own = case.wavelength
    if not _is_rising(case) or len(own) < 2:
        return "too few wavelengths to insert others"
    more = np.sort(np.concatenate([own, 0.5 * (own[1:] + own[:-1])]))
    finish = lambda signal: signal.reshape(len(more), -1)[::2].reshape(-1)  # noqa: E731
    return Variant(case.plan, with_wavelength(case.scene, more), finish)


def _sliced(count: int) -> Apply:
    return having(*_GRADED, partial(removed, HomogeneousSlices(count)))


_BACK, _GRADED = ("back-face", "the substrate has no back face"), ("gradient", "no layer is graded")
_CLOSED = ("coherence", "the full plan is the closed form")
ORDERS = (1, 2, 3, 5, 8)
SLICES, HOMOGENEOUS_SLICES = (2, 4, 8), (8, 32)

METHODS = (
    Method("float64", "nothing", lambda case: Variant(case.plan, case.scene)),
    Method("float32", "nine digits of sixteen", lambda case: Variant(case.plan, case.scene), double=False),
    Method(
        "planned",
        "what its plan leaves out",
        lambda case: Variant(plan(case.scene, case.tolerance), case.scene),
    ),
    Method("closed form", "the damping of fringes", having(*_CLOSED, partial(_damping, on=False))),
    *(Method(f"{m} order{'s' * (m > 1)}", "higher orders", partial(_orders, m)) for m in ORDERS),
    Method("incoherent", "interference", partial(_orders, 0)),
    *(Method(f"{n} nodes", "finer averages", partial(_nodes, n)) for n in (3, 7)),
    Method("normal incidence", "the angle", without("oblique", "the light is at normal incidence")),
    Method("s alone", "p", without("polarisation", "there is only one polarisation")),
    Method("one ray", "the cone of light", without("angle-spread", "no cone of light")),
    Method("half space", "the plate's back face", without(*_BACK)),
    Method("one back reflection", "later ones", having(*_BACK, _one_reflection)),
    Method("all collected", "that part of the light misses the detector", having(*_BACK, _all_collected)),
    Method("smooth faces", "roughness", without("roughness", "every face is smooth")),
    Method("isotropic average", "birefringence", without("anisotropy", "no medium is birefringent")),
    Method("aligned axes", "the tilt of optic axes", aligned_axes),
    Method("4×4 matrices", "nothing", general_matrices),
    Method("mean of the depth", "the gradient", without(*_GRADED)),
    *(Method(f"{n} slices", "finer slices", having(*_GRADED, partial(fewer_slices, n))) for n in SLICES),
    *(Method(f"{n} homogeneous slices", "the gradient within each", _sliced(n)) for n in HOMOGENEOUS_SLICES),
    Method("transparent layer", "its absorption", having("absorption", "no layer absorbs", transparent)),
    Method("constant index", "dispersion: the index of mid-band", constant_index),
    Method("twice the wavelengths", "nothing", _finer),
    *(
        Method(f"every {nth} wavelength", "the others: interpolated", partial(_coarser, step))
        for step, nth in ((2, "2nd"), (4, "4th"), (8, "8th"))
    ),
)
"""Every method of simulating a scene, in the order of the table."""


REFERENCES = ("float64", "mpmath")
MP_DRAWS, MP_WAVELENGTHS = 12, 25
"""Most draws and wavelengths of a case that are computed to 50 digits."""


class Reference(NamedTuple):
    """Signal of a case, (draws, wavelengths, channels), at some of its draws and wavelengths."""

    name: str
    values: np.ndarray
    draws: np.ndarray
    wavelengths: np.ndarray

    def error(self, case: Case, signal: np.ndarray) -> float:
        """The largest error of a signal (draws, points), in its unit.

        For Ψ and Δ it is the arc between two points (N, C, S) in degrees: an error of Ψ counts twice,
        one of Δ sin 2Ψ times. Infinite where the signal is not finite and the reference is.
        """
        rows = signal.reshape(len(signal), len(case.wavelength), -1)[self.draws][:, self.wavelengths]
        known = np.all(np.isfinite(self.values), axis=-1)
        apart = np.abs(np.asarray(rows, dtype=float) - self.values)[known]
        off = np.linalg.norm(apart, axis=-1) if case.in_degrees else apart
        worst = float(np.max(off, initial=0.0)) if np.all(np.isfinite(off)) else np.inf
        return float(np.rad2deg(worst)) if case.in_degrees else worst


def reference_signal(name: str, case: Case) -> Reference:
    """The signal of a case by the full plan in float64, or by mpmath with 50 digits.

    **Raises:** UsageError for another name and where mpmath cannot compute the case.
    """
    if name == "mpmath":
        return _by_mpmath(case)
    if name != "float64":
        raise UsageError(f"`reference` must be {' or '.join(REFERENCES)}, not {name!r}")
    signal = compiled(case, Variant(case.plan, case.scene)).run()
    rows = signal.reshape(len(signal), len(case.wavelength), -1)
    return Reference("float64", rows, np.arange(len(signal)), np.arange(len(case.wavelength)))


def _by_mpmath(case: Case) -> Reference:
    try:
        from pellicle.accuracy.high_precision import signal, unsuitable
    except ImportError:
        raise UsageError(
            f'`reference="mpmath"` needs mpmath: {install_command("reference")}; or use `reference="float64"`'
        ) from None
    why = unsuitable(case)
    if why is not None:
        raise UsageError(
            f'`reference="mpmath"` computes smooth, even layers at one wavelength and angle; {why}:'
            ' use `reference="float64"`'
        )
    draws = np.arange(min(MP_DRAWS, len(case.draws) if case.draws.shape[1] else 1))
    count = min(MP_WAVELENGTHS, len(case.wavelength))
    at = np.unique(np.linspace(0, len(case.wavelength) - 1, count).round().astype(int))
    return Reference("mpmath", np.stack([signal(case, case.draws[i], at) for i in draws]), draws, at)


def compare_methods(
    case: Case, reference: str, progress: Progress, methods: Sequence[Method] = METHODS
) -> Comparison:
    """Measure every method of simulating a case.

    **Raises:** UsageError for a `reference` that cannot compute the case and for a signal that is 0
    everywhere; ValueError where a material has no data at a wavelength.
    """
    truth = reference_signal(reference, case)
    known = truth.values[np.isfinite(truth.values)]
    if known.size == 0:
        raise UsageError("there is nothing to compute: the signal is not finite anywhere between the bounds")
    if not np.any(known):
        raise UsageError(
            f"there is nothing to compute: {case.plan.signal} is 0 everywhere between the bounds"
        )
    unit = "degrees" if case.in_degrees else case.plan.signal
    comparison = Comparison(
        "forward", truth.name, case.tolerance, unit, len(truth.wavelengths), len(truth.draws)
    )

    def prepare(method: Method) -> Program | str:
        variant = method.apply(case)
        return variant if isinstance(variant, str) else compiled(case, variant, method.double)

    return measure(comparison, methods, prepare, lambda signal: truth.error(case, signal), progress)
