"""Signal of a scene to 50 digits: characteristic matrices in mpmath, sharing no code with the forward model.

Source: H. A. Macleod, Thin-Film Optical Filters, chapter 2; incoherent plates by summed intensities.
The indices of the media are those of the forward model, rounded to float64.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import mpmath
import numpy as np

from pellicle.accuracy.case import Case
from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.forward_model.plan import GENERAL
from pellicle.scene.film import Scene, groups, thickness_spread, with_wavelength
from pellicle.scene.free import insert
from pellicle.scene.groups import written_out
from pellicle.signals.generalised import Generalised
from pellicle.signals.psi_delta import PsiDelta

mp: Any = mpmath.mp  # its functions are created at run time, which type checkers do not see
mpc: Any = mpmath.mpc
mpf: Any = mpmath.mpf

DIGITS = 50


def unsuitable(case: Case) -> str | None:
    """The reason why a case cannot be computed; None where it can."""
    scene, instrument = case.scene, case.scene.instrument
    uneven = (thickness_spread(scene, layer) for g in groups(scene)[0] for layer in g.layers)
    reasons = {
        "this light has a bandwidth": instrument.bandwidth is not None,
        "this layer's thickness is uneven": any(spread is not None for spread in uneven),
        "this light comes in a cone": instrument.has_cone,
        "an optic axis is tilted": case.plan.row("anisotropy").count >= GENERAL,
        "this layer's index varies with depth": case.plan.on("gradient"),
        "this scene has a rough face": case.plan.on("roughness"),
        "this ellipsometer sees a plate's other face": case.ellipsometric and case.plan.on("back-face"),
        "these fringes are narrower than the sampling": case.plan.on("coherence"),
    }
    return next((why for why, applies in reasons.items() if applies), None)


def signal(case: Case, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """R or T (wavelengths, 1), N, C, S (wavelengths, 3), those of each ratio (wavelengths, 9) or
    Mueller elements (wavelengths, 15), at some of a
    case's wavelengths."""
    scene = insert(case.scene, [float(x) for x in values])
    angle = np.broadcast_to(scene.light.angle, case.wavelength.shape)[at]
    scene = with_wavelength(scene, case.wavelength[at], angle)
    with mp.workdps(DIGITS):
        points = [_signal(scene, point) for point in _points(scene)]
    return np.array(points, dtype=float)


class _Group(NamedTuple):
    """Coherent layers between two thick media, at one wavelength."""

    above: Any
    layers: list[tuple[Any, Any]]  # index, thickness in nm
    below: Any


class _Point(NamedTuple):
    """A scene at one wavelength (nm)."""

    wavelength: Any
    angle: Any  # radians
    groups: list[_Group]
    plates_mm: list[Any]
    collected: Any  # share of the light from the back face, 0 to 1
    reflections: int | None  # the most at the back face, None for any


def _points(scene: Scene) -> list[_Point]:
    described, plates = groups(replace(scene, layers=written_out(scene.layers)))
    # a scene with several plates collects all light
    part = plates[0] if len(plates) == 1 else None
    share = 1.0 if part is None or part.back_collected is None else part.back_collected
    reflections = None if part is None else part.back_reflections
    wavelength = np.asarray(scene.light.wavelength)
    media = [(_indices(g.above, wavelength), _indices(g.below, wavelength)) for g in described]
    layers = [[(_indices(x.material, wavelength), _exact(x.thickness)) for x in g.layers] for g in described]
    shared = [_exact(plate.plate_mm) for plate in plates], _exact(share), reflections
    points = []
    for i, nm in enumerate(wavelength):
        each = [
            _Group(above[i], [(n[i], d) for n, d in within], below[i])
            for (above, below), within in zip(media, layers, strict=True)
        ]
        points.append(_Point(_exact(nm), _exact(scene.light.angle[i]) * mp.pi / 180, each, *shared))
    return points


def _exact(number: Any) -> Any:
    return mpf(float(number))


class _Principal(NamedTuple):
    """Indices along x (in the plane of incidence), y and z (the normal) of an aligned birefringent medium."""

    x: Any
    y: Any
    z: Any


def _indices(medium: Any, wavelength: np.ndarray) -> list[Any]:
    if isinstance(medium, Anisotropic) and medium.order is not None:
        principal = [medium.x, medium.x if medium.y is None else medium.y, medium.z]
        columns = (_indices(principal[i], wavelength) for i in medium.order)
        return [_Principal(*n) for n in zip(*columns, strict=True)]
    return [mpc(float(n.real), float(n.imag)) for n in np.asarray(medium(wavelength))]


def _signal(scene: Scene, point: _Point) -> list[Any]:
    light = scene.light
    if light.ellipsometric:
        s, p, cross = (_product(point, 0, letters) for letters in ("ss", "pp", "ps"))
        s, p = mp.re(s), mp.re(p)
        # tan Ψ e^{iΔ} = conj(r_p/r_s): N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ
        N, C, S = (s - p) / (s + p), 2 * mp.re(cross) / (s + p), -2 * mp.im(cross) / (s + p)
        if isinstance(light.kind, Generalised):
            return [N, C, S, 1, 0, 0, 1, 0, 0]
        return (
            [N, C, S] if isinstance(light.kind, PsiDelta) else [-N, 0, 0, -N, 1, *[0] * 4, C, S, 0, 0, -S, C]
        )
    letters = "sp" if light.polarisation == "unpolarised" else light.polarisation
    which = 1 if light.kind.transmitted else 0
    return [sum(_powers(point, 0, letter)[which] for letter in letters) / len(letters)]


def _powers(point: _Point, first: int, letter: str) -> tuple[Any, Any]:
    """R of a group and all under it, and T through them."""
    above, below = _sides(point, point.groups[first], letter)
    if first == len(point.groups) - 1:
        return above.R, above.T
    R_next, T_next = _powers(point, first + 1, letter)
    passed = _passed(point, first, letter)
    round_trip = below.R * R_next * passed**2
    returned = above.T * below.T * R_next * passed**2 * _orders(point, round_trip)
    further = round_trip * _orders(point, round_trip)
    return above.R + point.collected * returned, above.T * T_next * passed * (1 + point.collected * further)


def _passed(point: _Point, first: int, letter: str) -> Any:
    """Transmittance of one passage through the plate below a group."""
    q, _ = _wave(point, point.groups[first].below, letter)
    return mp.exp(-4 * mp.pi * mp.im(q) * point.plates_mm[first] * 10**6 / point.wavelength)


def _orders(point: _Point, round_trip: Any) -> Any:
    """Sum of the powers of what returns from one round trip in a plate, up to the reflections collected."""
    closed = 1 if point.reflections is None else 1 - round_trip**point.reflections
    return closed / (1 - round_trip)


def _product(point: _Point, first: int, letters: str) -> Any:
    """r conj(r) of a group and all under it, for two polarisations, summed over the plates' orders."""
    (above, below), (above_, below_) = (_sides(point, point.groups[first], x) for x in letters)
    if first == len(point.groups) - 1:
        return above.r * mp.conj(above_.r)
    beneath = _product(point, first + 1, letters) * _passed(point, first, letters[0]) ** 2
    twice = above.t * below.t * mp.conj(above_.t * below_.t)
    returned = twice * beneath * _orders(point, below.r * mp.conj(below_.r) * beneath)
    return above.r * mp.conj(above_.r) + point.collected * returned


def _wave(point: _Point, index: Any, letter: str) -> tuple[Any, Any]:
    """Normal index q of a wave in a medium, and the weight w of its admittance q/w."""
    a = point.groups[0].above * mp.sin(point.angle)
    x, y, z = index if isinstance(index, _Principal) else (index, index, index)
    q = mp.sqrt(y**2 - a**2) if letter == "s" else x / z * mp.sqrt(z**2 - a**2)
    return -q if mp.im(q) < 0 else q, mpc(1) if letter == "s" else x**2


class _Side(NamedTuple):
    """Amplitudes r and t of one group from one side, and its powers R and T."""

    r: Any
    t: Any
    R: Any
    T: Any


def _sides(point: _Point, group: _Group, letter: str) -> list[_Side]:
    """One group from above and from below; at normal incidence r_p = −r_s."""
    turned = _Group(group.below, group.layers[::-1], group.above)
    return [_side(point, one, letter) for one in (group, turned)]


def _side(point: _Point, group: _Group, letter: str) -> _Side:
    top, bottom = (q / weight for q, weight in (_wave(point, x, letter) for x in (group.above, group.below)))
    # (E, H) at the upper face for a unit wave that leaves below; in p they change places
    E, H = mpc(1), bottom
    for index, depth in reversed(group.layers):
        q, weight = _wave(point, index, letter)
        k0d = 2 * mp.pi * depth / point.wavelength
        cosine, sine = mp.cos(k0d * q), k0d * mp.sinc(k0d * q)  # the latter over q
        E, H = E * cosine - 1j * sine * weight * H, H * cosine - 1j * sine * q**2 / weight * E
    r, t = (top * E - H) / (top * E + H), 2 * top / (top * E + H)
    return _Side(r, t, abs(r) ** 2, abs(t) ** 2 * mp.re(bottom) / mp.re(top))
