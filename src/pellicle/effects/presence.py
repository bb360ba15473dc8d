"""Presence of each effect in a scene, judged from types and from the *bounds* of free parameters.

Start values decide nothing: a layer whose k is free and starts at 0 keeps its absorption, because
dR/dk is not 0 there. Anisotropic media have closed forms of s and p, or the 4×4 method where s and p mix.
"""

import numpy as np

from pellicle.dispersion.anisotropic import (
    Anisotropic,
    isotropic_in_plane,
    mixes_polarisations,
    principal_media,
)
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Constant
from pellicle.effects.differences import largest_attenuation, normal_incidence, upper
from pellicle.errors import UsageError
from pellicle.forward_model.plan import CLOSED_FORMS, GENERAL, SLICED, Row
from pellicle.materials import Material
from pellicle.optics.berreman.slices import DIRECT
from pellicle.optics.pair import real
from pellicle.scene.film import Scene, coherent_layers, groups, is_graded
from pellicle.scene.free import Free, free_leaves
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Interface, absorbs
from pellicle.scene.surface import SurfaceView


def anisotropy(scene: Scene) -> Row:
    """On where a medium is anisotropic, by matrices of 2×2 or 4×4, chosen by the type of its orientation.

    **Raises:** UsageError for what is not computed: see `_check`.
    """
    media = [medium for medium in scene_media(scene) if isinstance(medium, Anisotropic)]
    apart = "s and p stay apart" + (
        ", r_ps = r_sp = 0" if scene.light.kind.degrees and scene.light.kind.parts else ""
    )
    if scene.light.azimuth is not None and all(map(isotropic_in_plane, media)):
        apart += ", and the azimuth of the sample has no effect"
    if not media:
        unusual = apart != "s and p stay apart"
        return Row("anisotropy", False, "no medium is birefringent" + f": {apart}" * unusual)
    _check(scene)
    if any(map(mixes_polarisations, media)):
        why = "an optic axis is tilted or its angles are free: s and p mix, matrices of 4×4"
        if not any(map(mixes_polarisations, scene_media(scene, turned=False))):
            turns = "the rays of the cone have different planes of incidence"
            turns = turns if scene.light.azimuth is None else "the sample is turned"
            why = f"{turns}: s and p mix, matrices of 4×4"
        mixing = [x for x in coherent_layers(scene) if mixes_polarisations(_turned(x.material, scene))]
        # one of the waves that mix in a layer may be absorbed while the other passes
        if all(largest_attenuation(x.material, x.thickness, scene) <= DIRECT for x in mixing):
            return Row("anisotropy", True, why, count=GENERAL)
        return Row("anisotropy", True, f"{why}, in slices where one wave decays", count=SLICED)
    why = f"axes along the normal and the plane of incidence: {apart}, closed forms of 2×2"
    if scene.light.ellipsometric and groups(scene)[1]:
        why = f"{why}, and 4×4 where light crosses absorbing layers to the back face"
    return Row("anisotropy", True, why, count=CLOSED_FORMS)


def scene_media(scene: Scene, turned: bool = True) -> list[AbstractDispersion]:
    """Every medium of a scene but the ambient, from the top down; interfaces have none of their own.

    They are `turned` by the azimuth of the sample and, in a cone of light, against the planes of incidence of
    its rays.
    """
    back = [] if scene.substrate.back is None else [scene.substrate.back]
    layers = [layer.material for layer in scene.layers if not isinstance(layer, Interface)]
    media = [*layers, scene.substrate.material, *back]
    return [_turned(medium, scene) for medium in media] if turned else media


def _turned(medium: AbstractDispersion, scene: Scene) -> AbstractDispersion:
    azimuth = scene.light.azimuth
    if azimuth is None and scene.instrument.has_cone:
        azimuth = 0.0
    return medium.turned(azimuth) if azimuth is not None and isinstance(medium, Anisotropic) else medium


def _check(scene: Scene) -> None:
    """UsageError for an anisotropic medium where it is not computed."""
    if is_graded(scene):
        raise UsageError("a graded layer and a birefringent medium in one scene are not computed: omit one")
    thick = [_turned(plate.material, scene) for plate in groups(scene)[1]]
    if any(map(mixes_polarisations, thick)):
        axis = "the optic axis of an incoherent plate must be the normal"
        if scene.instrument.has_cone:
            axis = f"in a cone of light {axis}: give its angles as 0"
        else:
            axis += " or along the plane of incidence: give its angles as 0 or 90"
        raise UsageError(f"{axis}, or the plate one index")
    if scene.light.ellipsometric and any(isinstance(m, Anisotropic) for m in thick):
        raise UsageError(
            "the polarisation of light from the back face of a birefringent plate is not computed: leave out"
            " `back`, or measure R or T"
        )
    mixed = any(map(mixes_polarisations, scene_media(scene)))
    if mixed and any(isinstance(medium, Anisotropic) for medium in thick):
        raise UsageError(
            "a birefringent plate in a scene whose optic axis is tilted elsewhere is not computed: give the"
            " plate one index"
        )
    if roughness(scene).on and not computes_roughness(scene):
        if mixed:
            raise UsageError(
                "`roughness` under a tilted optic axis is not computed: in its place put a layer on top, of"
                " twice that thickness, whose principal media are mixtures with the ambient, half of each"
            )
        raise UsageError(
            "`roughness` of a birefringent film on a plate is computed for R and T only: leave out one of"
            " `roughness` and `back`"
        )


def computes_roughness(scene: Scene) -> bool:
    """True where rough faces of a scene are computed: not where s and p mix, or lose their phase."""
    media = scene_media(scene)
    phase_lost = scene.light.ellipsometric and groups(scene)[1]
    birefringent = any(isinstance(medium, Anisotropic) for medium in media)
    return not (any(map(mixes_polarisations, media)) or (birefringent and phase_lost))


def absorption(scene: Scene) -> Row:
    """On where a layer's extinction is free or not zero."""
    if any(absorbs(layer.material) for layer in coherent_layers(scene)):
        return Row("absorption", True, "a layer's extinction is free, or not zero")
    return Row("absorption", False, "no layer has any extinction, and none is free")


def stack(scene: Scene) -> Row:
    """On where the closed form of one layer does not apply: several layers, or rough faces."""
    count = max(sum(layer.repeats for layer in group.layers) for group in groups(scene)[0])
    if is_graded(scene):
        return Row("stack", True, "a graded layer: a product of the characteristic matrices of its slices")
    if count > 1:
        return Row("stack", True, f"{count} coherent layers: a product of characteristic matrices")
    if roughness(scene).on:
        return Row("stack", True, "rough faces between characteristic matrices")
    return Row("stack", False, "one layer: its closed form")


def roughness(scene: Scene) -> Row:
    """On where a face has a roughness, fixed or free."""
    faces = [upper(each) for group in groups(scene)[0] for each in group.roughness if each is not None]
    if not faces:
        return Row("roughness", False, "no face has a roughness")
    return Row("roughness", True, f"{len(faces)} rough: up to {max(faces):g} nm damps their reflection")


def oblique(scene: Scene) -> Row:
    """On at an angle of incidence other than 0, at a free one, and in a cone of light."""
    angle = scene.light.angle
    if scene.instrument.has_cone:
        return Row("oblique", True, "the light's cone has oblique rays")
    if normal_incidence(scene):
        return Row("oblique", False, "normal incidence, and the angle is not free")
    if isinstance(angle, Free):
        return Row("oblique", True, "the angle of incidence is free")
    if scene.instrument.angle_shift is not None:
        return Row("oblique", True, "the angle of incidence is shifted")
    span = " to ".join(f"{x:g}" for x in sorted({np.min(angle), np.max(angle)}))
    return Row("oblique", True, f"incidence at {span}°")


def tunnelling(scene: Scene) -> Row:
    """Off where every real index is provably above n₀ sin θ: the square root then needs no branch."""
    if not oblique(scene).on:
        return Row("tunnelling", False, "normal incidence: every wave propagates")
    unsure = dict.fromkeys(x for x, m in _media(scene) if not absorbs(m) and not _propagates(m, scene))
    if unsure:
        return Row("tunnelling", True, f"total reflection in the {' and '.join(unsure)} is possible")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def _media(scene: Scene) -> list[tuple[str, AbstractDispersion]]:
    """Every medium that a wave enters, with its name in messages; of anisotropic ones the principal media."""
    layers = [(i, x.material) for i, x in enumerate(scene.layers) if not isinstance(x, Interface)]
    names = {id(material): name(scene, i) for i, material in layers}
    named = [(names.get(id(x.material), "interface"), x.material) for x in coherent_layers(scene)]
    named += [(names.get(id(g.below), "substrate"), g.below) for g in groups(scene)[0]]
    return [
        (name, principal)
        for name, medium in named
        for part in ((medium.first, medium.second) if isinstance(medium, Graded) else (medium,))
        for principal in principal_media(part)
    ]


def name(scene: Scene, position: int) -> str:
    """Name of a layer in messages: its own, or by its position (`layer2`)."""
    return "layer" if len(scene.layers) == 1 else scene.layers[position].name or f"layer{position + 1}"


def _propagates(material, scene: Scene) -> bool:
    angle, wavelength = scene.light.angle, scene.light.wavelength
    if free_leaves(material) or isinstance(angle, Free) or wavelength is None or free_leaves(scene.ambient):
        return False
    nm = np.asarray(wavelength, dtype=float)
    index, ambient = (real(known_index(medium, nm)) for medium in (material, scene.ambient))
    shift = scene.instrument.angle_shift
    steepest = np.deg2rad(angle + upper(shift)) + scene.instrument.largest_half_angle(float(np.min(ambient)))
    return bool(np.all(index > ambient * np.sin(np.minimum(steepest, np.pi / 2)) * (1 + 1e-6)))


def polarisation(scene: Scene) -> Row:
    """On where s and p differ and both are needed."""
    if scene.light.ellipsometric:
        return Row("polarisation", True, "ellipsometry compares p with s")
    if scene.instrument.has_cone and not any(map(mixes_polarisations, scene_media(scene))):
        return Row("polarisation", True, "the light's cone has s and p")
    if normal_incidence(scene) and all(map(isotropic_in_plane, scene_media(scene))):
        return Row("polarisation", False, "s and p are equal at normal incidence")
    if scene.light.polarisation != "unpolarised":
        return Row("polarisation", False, f"the light is {scene.light.polarisation}-polarised")
    if normal_incidence(scene):
        return Row("polarisation", True, "the optic axis of a medium is not the normal: the mean of s and p")
    return Row("polarisation", True, "unpolarised light at an angle: the mean of s and p")


def transmission(scene: Scene) -> Row:
    """On where the signal, or the back face of a plate, needs the transmitted light."""
    if scene.light.kind.transmitted:
        noun = "transmittance" if scene.light.signal == "T" else "comparison of transmitted light"
        return Row("transmission", True, f"the signal is a {noun}")
    if back_face(scene).on:
        return Row("transmission", True, "light that reaches the back face returns through the layer")
    return Row("transmission", False, "the signal is a reflectance and the substrate has no back face")


def back_face(scene: Scene) -> Row:
    """On where there is a plate: the intensities from its faces add up."""
    plates = groups(scene)[1]
    if not plates:
        return Row("back-face", False, "the substrate is a half space, without a back face")
    share, count = plates[0].back_collected, plates[0].back_reflections
    if isinstance(share, int | float) and share == 0 and not scene.light.kind.transmitted:
        return Row("back-face", False, "no light from the back face is collected (back_collected = 0)")
    words = []
    if isinstance(share, Free):
        words.append("the share that is collected is free")
    elif isinstance(share, int | float):
        words.append(f"{100 * share:g} % of it is collected")
    if count is not None:
        words.append(f"up to {count} reflection{'s' * (count > 1)} there count{'s' * (count == 1)}")
    part = f"; {', '.join(words)}" if words else ""
    if len(plates) == 1 and scene.substrate.back is not None:
        return Row("back-face", True, f"the substrate is a plate; its back face adds incoherently{part}")
    number = f"{len(plates)} incoherent plates" if len(plates) > 1 else "1 incoherent plate"
    return Row("back-face", True, f"{number}: the intensities from the faces add up{part}")


def dispersion(scene: Scene) -> Row:
    """On where an index varies with the wavelength."""
    nm = scene.light.wavelength
    media = [*_media(scene), ("ambient", scene.ambient)]
    bare = [(name, m.dispersion if isinstance(m, Material) else m) for name, m in media]
    varying = dict.fromkeys(name for name, m in bare if not isinstance(m, Constant))
    if nm is not None and np.size(np.unique(nm)) == 1:
        return Row("dispersion", False, "one wavelength")
    words = f"the index of {' and '.join(varying)}" if varying else "no index"
    return Row("dispersion", bool(varying), f"{words} varies with the wavelength")


def opaque(scene: Scene) -> Row:
    """Off: only within a tolerance may an opaque layer hide what lies beneath (see `film_plan`)."""
    return Row("opaque", False, "light may reach every layer and the substrate")


def precision(scene: Scene | SurfaceView) -> Row:
    """On: only a tolerance permits single precision (`effects.film_plan`, `effects.surface_plan`)."""
    return Row("precision", True, "double precision, where JAX has it enabled")
