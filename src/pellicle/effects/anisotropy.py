"""Anisotropic media of a scene: closed forms of s and p, or the 4×4 method where s and p mix."""

from typing import Any

from pellicle.dispersion.anisotropic import Anisotropic, isotropic_in_plane, mixes_polarisations
from pellicle.effects.differences import largest_attenuation
from pellicle.errors import UsageError
from pellicle.forward_model.plan import CLOSED_FORMS, GENERAL, SLICED, Row
from pellicle.optics.berreman.slices import DIRECT
from pellicle.scene.film import Scene, coherent_layers, groups, is_graded
from pellicle.scene.layers import Interface

_PLANES = "the rays of the cone have different planes of incidence"


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
        if not any(isinstance(m, Anisotropic) and mixes_polarisations(m) for m in _media(scene)):
            turns = "the sample is turned" if scene.light.azimuth is not None else _PLANES
            why = f"{turns}: s and p mix, matrices of 4×4"
        if any(_strongly_dichroic(layer, scene) for layer in coherent_layers(scene)):
            return Row("anisotropy", True, f"{why}, in slices where one wave decays", count=SLICED)
        return Row("anisotropy", True, why, count=GENERAL)
    why = f"axes along the normal and the plane of incidence: {apart}, closed forms of 2×2"
    if scene.light.ellipsometric and groups(scene)[1]:
        why = f"{why}, and 4×4 where light crosses absorbing layers to the back face"
    return Row("anisotropy", True, why, count=CLOSED_FORMS)


def _strongly_dichroic(layer: Any, scene: Scene) -> bool:
    """True where one of the waves that mix in a layer may be absorbed while the other passes."""
    mixing = mixes_polarisations(_turned(layer.material, scene))
    return mixing and not largest_attenuation(layer.material, layer.thickness, scene) <= DIRECT


def scene_media(scene: Scene) -> list[Any]:
    """Every medium of a scene but the ambient, from the top down, turned by the azimuth of the sample and, in
    a cone of light, against the planes of incidence of its rays; interfaces have none of their own."""
    return [_turned(medium, scene) for medium in _media(scene)]


def _turned(medium: Any, scene: Scene) -> Any:
    azimuth = scene.light.azimuth
    if azimuth is None and scene.instrument.has_cone:
        azimuth = 0.0
    return medium.turned(azimuth) if azimuth is not None and isinstance(medium, Anisotropic) else medium


def _media(scene: Scene) -> list[Any]:
    back = [] if scene.substrate.back is None else [scene.substrate.back]
    layers = [layer.material for layer in scene.layers if not isinstance(layer, Interface)]
    return [*layers, scene.substrate.material, *back]


def _check(scene: Scene) -> None:
    """UsageError for an anisotropic medium where it is not computed."""
    if is_graded(scene):
        raise UsageError("a graded layer and a birefringent medium in one scene are not computed: omit one")
    described, plates = groups(scene)
    thick = [_turned(plate.material, scene) for plate in plates]
    if any(map(mixes_polarisations, thick)):
        if scene.instrument.has_cone:
            raise UsageError(
                "in a cone of light the optic axis of an incoherent plate must be the normal: give its angles"
                " as 0, or the plate one index"
            )
        raise UsageError(
            "the optic axis of an incoherent plate must be the normal or along the plane of incidence:"
            " give its angles as 0 or 90, or the plate one index"
        )
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
    rough = any(face is not None for group in described for face in group.roughness)
    if rough and not computes_roughness(scene):
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
    if any(map(mixes_polarisations, media)):
        return False
    birefringent = any(isinstance(medium, Anisotropic) for medium in media)
    return not (birefringent and scene.light.ellipsometric and groups(scene)[1])
