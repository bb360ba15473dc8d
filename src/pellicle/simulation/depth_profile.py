"""Absorption of light in a film: absorptance of each layer, |E|² and absorbed power density against depth.

Each group is lit from above with a power F and, by light that a plate returns, from below with a power B;
their intensities add. Between the faces of a plate light is absorbed on its way down and up. In a plate that
absorbs, the incident wave and its reflection at a face also exchange power, of the order of k/n: it counts as
absorbed in the plate, as in Byrnes, arXiv:1603.02720, section 5. So does the difference, (k/n)², that
`plate.plate_reflectance` makes by taking the front face's transmittance to be the same both ways. With the R
and T of the forward model all absorptances then add up to 1.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from pellicle.effects.film_plan import exact
from pellicle.errors import UsageError
from pellicle.forward_model.coherent_groups import CoherentGroup, coherent_groups, powers, responses_of
from pellicle.forward_model.film_signal import tabulated
from pellicle.forward_model.plan import Plan
from pellicle.optics import interface, plate, response
from pellicle.optics.field import absorptances, fields
from pellicle.optics.interface import transverse
from pellicle.optics.pair import Number, abs2, imag, real
from pellicle.scene.film import Scene, all_collected, groups, sliced, with_wavelength
from pellicle.scene.free import insert, start_values
from pellicle.scene.graded import Graded
from pellicle.scene.groups import written_out
from pellicle.scene.instrument import Instrument
from pellicle.scene.layers import Interface, Layer, Plate


class AbsorbedPower(NamedTuple):
    """Shares of the incident power for one polarisation, at each wavelength."""

    R: Any
    T: Any
    layers: list[Any]  # (layers, ...) of each coherent group
    plates: list[Any]
    down: list[Any]  # power that arrives at each group from above
    up: list[Any]  # and from below, 0 for the last group


def absorbed_power(
    plan: Plan, groups: list[CoherentGroup], plates: tuple[Plate, ...], wavelength: Any, polarisation: str
) -> AbsorbedPower:
    """Return R, T, and what every layer and plate absorbs. `plates` are those between the groups."""
    responses = [responses_of(plan, group, polarisation)[0] for group in groups]
    arriving, layers, inner, down, up = jnp.ones_like(wavelength), [], [], [], []
    for i, group in enumerate(groups):
        down.append(arriving)
        absorbed = arriving * _layers(group, polarisation)
        if i == len(plates):
            up.append(jnp.zeros_like(arriving))
            layers.append(absorbed)
            break
        [below], passed = powers(plan, groups[i + 1 :], polarisation, False), group.internal
        returning = response.reflectance_below(responses[i])
        first = arriving * response.transmittance(responses[i]) / (1 - returning * below * passed**2)
        arriving = first * passed
        back = arriving * below * passed
        up.append(back)
        layers.append(absorbed + back * _layers(upside_down(groups, i), polarisation))
        _, q = interface.transverse(group.below, _inside(groups))
        lost = plate.internal_absorptance(imag(q), plates[i].plate_mm, wavelength)
        faces = back * _upward_difference(groups, i, responses[i], q, polarisation)
        faces += arriving * _exchange(group.below, q, _ratio(responses[i + 1]), polarisation)
        inner.append((first + arriving * below) * lost + faces)
    R, T = (powers(plan, groups, polarisation, through)[0] for through in (False, True))
    return AbsorbedPower(R, T, layers, inner, down, up)


def energy(
    groups: list[CoherentGroup],
    position: int,
    wavelength: Any,
    thicknesses: list[Any],
    depth: Any,
    powers: AbsorbedPower,
    polarisation: str,
) -> tuple[Any, Any]:
    """Return |E|² at a depth of a group for a unit of incident power, and Im ε there.

    **Arguments:** `thicknesses` of the group's layers in nm, each with the shape of `wavelength`; `depth` in
    nm from its uppermost interface, on none of the interfaces.
    """
    k0 = 2 * jnp.pi / wavelength

    def lit(group: CoherentGroup, depths: list[Any], at: Any) -> Any:
        angle = interface.Inside(0.0) if group.angle is None else group.angle
        return fields(group.above, group.layers, group.below, k0, depths, at, angle, polarisation)[0]

    from_above = lit(groups[position], thicknesses, depth)
    both = powers.down[position] * from_above.energy()
    if position < len(groups) - 1:
        total = sum(thicknesses, 0.0 * wavelength)
        from_below = lit(upside_down(groups, position), thicknesses[::-1], total - depth)
        both += powers.up[position] * from_below.energy()
    return both, from_above.loss


def upside_down(groups: list[CoherentGroup], position: int) -> CoherentGroup:
    """Return a group as light from the plate below it meets it."""
    group = groups[position]
    return group._replace(
        above=group.below,
        layers=group.layers[::-1],
        below=group.above,
        phases=group.phases[::-1],
        angle=_inside(groups),
    )


def _inside(groups: list[CoherentGroup]) -> Any:
    """The transverse index in place of an angle, for light from within a plate."""
    angle = groups[0].angle
    return None if angle is None else interface.Inside(interface.transverse(groups[0].above, angle)[0])


def _layers(group: CoherentGroup, polarisation: str) -> Any:
    film = (group.above, group.layers, group.below, group.phases, group.angle)
    return absorptances(*film, polarisation)[0]


def _ratio(waves: response.Response, from_below: bool = False) -> Number:
    return (waves.below if from_below else waves.reflected) / waves.denominator


def _exchange(index: Number, q: Number, r: Number, polarisation: str) -> Any:
    """Return 1 − |r|² − (the power through the face) for light from a medium: −2 Im r Im Y/Re Y."""
    admittance = q if polarisation == "s" else q / (index * index)
    flux = real(admittance)
    none = flux == 0
    return jnp.where(none, 0.0, -2 * imag(r) * imag(admittance) / jnp.where(none, 1.0, flux))


def _upward_difference(
    groups: list[CoherentGroup], position: int, waves: response.Response, q: Number, polarisation: str
) -> Any:
    """Power that light from a plate loses at the face above it, besides R, A and T of light from above."""
    group = groups[position]
    exchanged = _exchange(group.below, q, _ratio(waves, from_below=True), polarisation)
    _, q_above = interface.transverse(group.above, group.angle)
    here, above = _sine_square(group.below, q, polarisation), _sine_square(group.above, q_above, polarisation)
    evanescent = here == 1
    ratio = (here - above) / jnp.where(evanescent, 1.0, 1 - here)
    return exchanged + jnp.where(evanescent, 0.0, response.transmittance(waves) * ratio)


def _sine_square(index: Number, q: Number, polarisation: str) -> Any:
    """(Im Y/|Y|)² of a medium's admittance Y."""
    admittance = q if polarisation == "s" else q / (index * index)
    return imag(admittance) ** 2 / abs2(admittance)


POINTS = 200
"""Depths in each layer, and on each side of the layers."""
EDGE = 1e-6
"""Distance of the outermost depths of a layer from its faces, a share of its thickness."""
SLICES = 64
"""Homogeneous slices of a graded layer: R, T and absorptances are within about 1e-5. The field is
shown in their middles, where the absorption is that of the graded layer."""
MARGIN = 0.25
"""Depth shown in the media above and below, a share of the thickness of the layers."""


@dataclass(frozen=True)
class Section:
    """Field in one coherent group of layers, between the ambient, plates and the substrate.

    `layers` are name and depth of the upper and lower face in nm, from the uppermost interface of the group;
    `above` and `below` the media around it. At each `depth` (depths,) in nm there are the name of the
    `medium`, the `intensity` |E|² relative to the incident wave and the share of the incident power that is
    `absorbed` per nm, both (chosen wavelengths, depths).
    """

    layers: tuple[tuple[str, float, float], ...]
    above: str
    below: str
    medium: tuple[str, ...]
    depth: np.ndarray
    intensity: np.ndarray
    absorbed: np.ndarray


@dataclass(frozen=True)
class DepthProfile:
    """Absorption of a film against wavelength and against depth.

    `absorptance` (media, wavelengths) is that of each layer and plate in `media`, from the ambient down. With
    `R` and `T` (wavelengths,) it adds up to 1; T enters the substrate, or the medium behind its back face.
    Both are of all light, also where a detector collects only a part of that from a back face.
    `sections` have the field at the wavelengths `at`, one for each group of layers between thick media;
    `shares` (chosen wavelengths,) are R, T and the absorptances there, by name.
    """

    wavelength: np.ndarray
    R: np.ndarray
    T: np.ndarray
    media: tuple[str, ...]
    absorptance: np.ndarray
    at: np.ndarray
    shares: dict[str, np.ndarray]
    sections: tuple[Section, ...]


def depth_profile(scene: Scene, at: ArrayLike, wavelength: ArrayLike) -> DepthProfile:
    """Compute a depth profile, as `pellicle.depth_profile` does.

    **Raises:** UsageError for rough faces and for several angles; ValueError where a material has no data.
    """
    if any(face is not None for group in groups(scene)[0] for face in group.roughness):
        raise UsageError(
            "a rough face scatters light, and the field at it has no value: describe it as a mixed interface,"
            ' pl.Interface(thickness), or in a recipe a layer with between = "bruggeman"'
        )
    if np.size(scene.light.angle) != 1:
        raise UsageError("a depth profile has one angle of incidence: give the light one `angle`")
    chosen, nm = np.atleast_1d(np.asarray(at, dtype=float)), np.asarray(wavelength, dtype=float)
    if chosen.size == 0 or not np.all(np.isfinite(chosen) & (chosen > 0)):
        raise UsageError("the wavelengths of a depth profile must be numbers of nm above zero")
    with jax.enable_x64(True):
        fixed = all_collected(insert(scene, start_values(scene)))
        fixed = replace(fixed, layers=written_out(fixed.layers))
        names, runs = _names(fixed)
        plane = [replace(x, thickness_spread=None) if isinstance(x, Layer) else x for x in fixed.layers]
        fixed = eqx.tree_at(lambda s: (s.layers, s.instrument), fixed, (tuple(plane), Instrument()))
        fixed = sliced(fixed, SLICES)
        every = with_wavelength(fixed, np.concatenate([nm, chosen]))
        plan = exact(every)
        powers = _mean_powers(tabulated(every), plan=plan.static_key, letters=_polarisations(plan, every))
        R, T, layers, plates = jax.tree.map(np.asarray, powers)
        rows: dict[str, Any] = {}
        for i, run in enumerate(runs):
            ends = np.cumsum([0, *(count for _, count in run)])
            for (name, count), start in zip(run, ends[:-1], strict=True):
                rows[name] = np.sum(layers[i][start : start + count], axis=0)
            if i < len(plates):
                rows[names[i]] = plates[i]
        sections = _sections(plan, fixed, chosen, names, runs)
    own, there = slice(nm.size), slice(nm.size, None)
    absorptance = np.array([*rows.values()])
    shares = {name: row[there] for name, row in {"R": R, "T": T, **rows}.items()}
    return DepthProfile(nm, R[own], T[own], tuple(rows), absorptance[:, own], chosen, shares, sections)


def _names(scene: Scene) -> tuple[list[str], list[list[tuple[str, int]]]]:
    """Names of the plates, and of the layers of each coherent group with the number of slices of each."""
    taken: set[str] = {"R", "T", "ambient", "substrate"}

    def unique(item: Any, position: int) -> str:
        name = item.name or getattr(getattr(item, "material", None), "name", None) or f"layer{position}"
        name = name if name not in taken else f"{name} ({position})"
        taken.add(name)
        return name

    plates: list[str] = []
    runs: list[list[tuple[str, int]]] = [[]]
    for position, item in enumerate(scene.layers, start=1):
        name = unique(item, position)
        if isinstance(item, Plate):
            plates.append(name)
            runs.append([])
        else:
            slices = item.steps if isinstance(item, Interface) else 1
            runs[-1].append((name, SLICES if isinstance(getattr(item, "material", None), Graded) else slices))
    if scene.substrate.back is not None:
        plates.append("substrate")
        runs.append([])
    return plates, runs


def _polarisations(plan: Plan, scene: Scene) -> str:
    if not plan.on("oblique"):
        return "s"
    return "sp" if scene.light.polarisation == "unpolarised" else scene.light.polarisation


@partial(jax.jit, static_argnames=("plan", "letters"))
def _mean_powers(scene: Scene, plan: Plan, letters: str) -> Any:
    film = coherent_groups(plan, scene), groups(scene)[1], jnp.asarray(scene.light.wavelength)
    powers = [absorbed_power(plan, *film, letter)[:4] for letter in letters]
    return jax.tree.map(lambda *x: sum(x) / len(x), *powers)


@partial(jax.jit, static_argnames=("plan", "letters", "position"))
def _at_depths(
    scene: Scene, depth: Any, thicknesses: list[Any], plan: Plan, letters: str, position: int
) -> tuple[Any, Any]:
    """|E|² and the absorbed share of the power per nm at depths of a group, at one wavelength."""
    coherent, wavelength = coherent_groups(plan, scene), jnp.asarray(scene.light.wavelength)
    thicknesses = [d * jnp.ones_like(wavelength) for d in thicknesses]
    per_power = density = jnp.zeros_like(depth)
    for letter in letters:
        powers = absorbed_power(plan, coherent, groups(scene)[1], wavelength, letter)
        E, loss = energy(coherent, position, wavelength, thicknesses, depth, powers, letter)
        per_power += E / len(letters)
        density += 2 * jnp.pi / wavelength * loss * E / len(letters)
    return transverse(coherent[0].above, coherent[0].angle)[1] * per_power, density


def _sections(
    plan: Plan, scene: Scene, chosen: np.ndarray, names: list[str], runs: list[list[tuple[str, int]]]
) -> tuple[Section, ...]:
    letters = _polarisations(plan, scene)
    edges = ["ambient", *names, "substrate" if scene.substrate.back is None else "behind the substrate"]
    sections = []
    for i, (group, run) in enumerate(zip(groups(scene)[0], runs, strict=True)):
        if not group.layers:
            continue
        thicknesses: list[Any] = [layer.thickness for layer in group.layers]
        faces = np.concatenate([[0.0], np.cumsum([float(d) for d in thicknesses])])
        ends = np.cumsum([0, *(count for _, count in run)])
        slices = [(name, faces[a : b + 1]) for (name, _), a, b in zip(run, ends[:-1], ends[1:], strict=True)]
        layers = tuple((name, float(within[0]), float(within[-1])) for name, within in slices)
        depth, medium = _depths(edges[i], slices, edges[i + 1])
        static = {"plan": plan.static_key, "letters": letters, "position": i}
        scenes = (tabulated(with_wavelength(scene, chosen[j : j + 1])) for j in range(len(chosen)))
        rows = [_at_depths(one, depth, thicknesses, **static) for one in scenes]
        intensity, absorbed = (np.array(x) for x in zip(*rows, strict=True))
        sections.append(Section(layers, edges[i], edges[i + 1], medium, depth, intensity, absorbed))
    return tuple(sections)


def _depths(
    above: str, layers: list[tuple[str, np.ndarray]], below: str
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Depths in the media above, in each slice of each layer and below, off the interfaces; their media.

    `layers` have the faces of their slices.
    """
    total = layers[-1][1][-1]
    margin = max(MARGIN * total, 20.0)
    spans = [(above, -margin, 0.0, POINTS)]
    for name, faces in layers:
        slices = len(faces) - 1
        count = 1 if slices == SLICES else max(POINTS // slices, 2)  # of each slice
        spans += [(name, faces[j], faces[j + 1], count) for j in range(slices)]
    spans.append((below, total, total + margin, POINTS))
    shares = [np.linspace(EDGE, 1 - EDGE, count) if count > 1 else np.array([0.5]) for *_, count in spans]
    parts = [x + share * (y - x) for (_, x, y, _), share in zip(spans, shares, strict=True)]
    kept = [(span[0], part) for span, part in zip(spans, parts, strict=True) if span[2] > span[1]]
    return np.concatenate([part for _, part in kept]), tuple(name for name, part in kept for _ in part)
