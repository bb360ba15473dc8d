"""Mitsuba 3: tabulated `.bsdf` files of the built-in `measured`, a lookup for a BSDF in Python, and scenes.

Beside `film.bsdf` (RGB) and `film_spectral.bsdf` there are `film.npz` with the lookup over thickness and
cosine, `pellicle_film.py`, the BSDF that reads it, and two scenes of a sphere: `film.xml` by `measured`,
which needs no Python, and `film_lookup.xml` by the lookup, whose thickness may vary over the surface.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Float
from jinja2 import Template

from pellicle.brdf.lobes import microfacets
from pellicle.colour import integration_bands, sensor
from pellicle.colour.spaces import srgb_matrix
from pellicle.data.brdf_samples import angles, vectors
from pellicle.data.formats.rgl import write_tensors
from pellicle.data.rgl_tables import ISOTROPIC, Brdf, TableSize, tabulate
from pellicle.errors import UsageError
from pellicle.files import replacing, write_text
from pellicle.rendering.appearance import Appearance
from pellicle.rendering.targets import Material, Target, write_grey_image
from pellicle.scene.surface import Surface
from pellicle.simulation.brdf import Directions, simulate_samples
from pellicle.simulation.colours import BANDS

ALPHA = 0.1
"""GGX roughness of a film that has none of its own: `measured` has no perfect mirrors."""
PLUGIN = "pellicle_film"


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write tables, plugin and scenes beside each other, the tables alone for a `.bsdf`.

    An uneven film has no `.bsdf`, whose directions are those of one thickness.
    """
    look, uneven = material.look, material.thickness_map is not None
    alpha = look.roughness if look.roughness > 0 else ALPHA
    chosen = _paths(path, uneven)
    for key, file in chosen.items():
        if file.exists() and key != "plugin":  # the same for every film
            raise UsageError(f"{file}: exists and is not overwritten; choose another `path` or remove it")
    if "rgb" in chosen:
        for key, fields in zip(("rgb", "spectral"), film_tables(look, alpha), strict=True):
            write_tensors(chosen[key], fields)
    if "lookup" in chosen:
        arrays: dict[str, Any] = dict(lookup(look).arrays())
        with replacing(chosen["lookup"]) as temporary:
            np.savez_compressed(temporary, **arrays)
        write_text(chosen["plugin"], _text("mitsuba_plugin.py"), overwrite=True)
        nm = look.thickness if material.thickness_map is None else material.thickness_map
        if "map" in chosen:
            write_grey_image(chosen["map"], nm)
        scene = {
            "comment": f"import {PLUGIN} and call its register() first, see there",
            "table": chosen["lookup"].name,
            "alpha": f"{alpha:g}",
            "map": chosen["map"].name if uneven else "",
            "least": f"{np.min(nm):.6g}",
            "largest": f"{np.max(nm):.6g}",
        }
        write_text(chosen["scene"], _scene(scene))
    if "measured" in chosen:
        note = f"mitsuba -m scalar_rgb {path.name}; in spectral variants -D table={chosen['spectral'].name}"
        scene = {"comment": note, "measured": True, "table": chosen["rgb"].name}
        write_text(chosen["measured"], _scene(scene))
    return tuple(chosen.values())


def _paths(path: Path, uneven: bool) -> dict[str, Path]:
    """The files that are written, by what they are."""
    names = {
        "rgb": f"{path.stem}.bsdf",
        "spectral": f"{path.stem}_spectral.bsdf",
        "lookup": f"{path.stem}.npz",
        "plugin": f"{PLUGIN}.py",
        "measured": f"{path.stem}.xml",
        "scene": f"{path.stem}_lookup.xml",
    }
    if path.suffix.lower() == ".bsdf":
        if uneven:
            raise UsageError(f"{path}: a .bsdf has one thickness; export a map of thicknesses as .xml")
        names = {key: names[key] for key in ("rgb", "spectral")}
    elif uneven:
        names = names | {"map": f"{path.stem}_thickness.png", "scene": names["measured"]}
        names = {key: names[key] for key in ("lookup", "map", "plugin", "scene")}
    return {key: path.with_name(name) for key, name in names.items()}


def _scene(content: Mapping[str, Any]) -> str:
    """Text of a scene with a sphere."""
    how: Any = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    return Template(_text("mitsuba_scene.xml"), **how).render(content)


def _text(name: str) -> str:
    return files("pellicle.rendering").joinpath(name).read_text("utf-8")


WAVELENGTHS = np.arange(380.0, 731.0, 5.0)
"""Wavelengths (nm) of spectral tables; beyond them less than 0.01 % of the light is seen."""
SPECTRAL = TableSize(thetas=32, side=32)
"""Nodes of a spectral `.bsdf` file: 11 MB."""
ANISOTROPIC = TableSize(33, 24, 32)
"""Nodes of the `.bsdf` file of a surface that is not isotropic: 11 MB."""
_STEP, _FEWEST, _MOST = 0.4, 64, 512
"""Step (nm) between the thicknesses of a lookup, and bounds of their number."""
_COSINES = 64
_FINE = np.linspace(0.0, 1.0, 1001)


@dataclass(frozen=True)
class Lookup:
    """Reflectance of a film over its thickness and the cosine of the angle of incidence, in even steps.

    `rgb` (thicknesses, cosines, 3) is linear sRGB under D65, clipped below at 0 where interference colours
    exceed its gamut: Mitsuba drops negative samples. `spectra` (thicknesses, cosines, wavelengths) is the
    reflectance at `WAVELENGTHS`. `thickness` is the range and `own` the film's own one, in nm; cosines run
    from 0 to 1.
    """

    rgb: Float[np.ndarray, "thicknesses cosines 3"]
    spectra: Float[np.ndarray, "thicknesses cosines wavelengths"]
    thickness: tuple[float, float]
    own: float

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays by name, as `mitsuba_plugin` reads them."""
        return {
            "rgb": self.rgb.astype(np.float32),
            "spectra": self.spectra.astype(np.float32),
            "wavelength": WAVELENGTHS,
            "thickness": np.array(self.thickness),
            "default_thickness": np.array(self.own),
        }


def lookup(look: Appearance) -> Lookup:
    """Tabulate a film from thickness 0 to a quarter above its own (the largest of an uneven film)."""
    own = float(look.thickness[-1])
    span = (0.0, 1.25 * own if own > 0 else 1.0)
    nm = np.linspace(*span, int(np.clip(np.ceil(span[1] / _STEP), _FEWEST, _MOST)))
    cosine = np.linspace(0.0, 1.0, _COSINES)
    return Lookup(*_reflectances(look, nm, cosine), span, own)


def film_tables(look: Appearance, alpha: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the fields of two `.bsdf` files of an even film on GGX facets, in RGB and spectral."""
    own, text = look.thickness[-1:], f"film of {look.thickness[-1]:.6g} nm on GGX facets, alpha {alpha:g}"
    rgb, spectra = (values[0] for values in _reflectances(look, own, _FINE))
    return (
        tabulate(facets(rgb, alpha), ISOTROPIC, description=text),
        tabulate(facets(spectra, alpha), SPECTRAL, wavelengths=WAVELENGTHS, description=text),
    )


def facets(reflectance: np.ndarray, alpha: float) -> Brdf:
    """BRDF of GGX facets whose reflectance (cosines, channels) is given at even cosines from 0 to 1."""
    steps = np.linspace(0.0, 1.0, len(reflectance))

    def brdf(i: np.ndarray, o: np.ndarray) -> np.ndarray:
        with jax.enable_x64(True):
            lobe = np.asarray(microfacets(np.ascontiguousarray(i.T), np.ascontiguousarray(o.T), alpha))
        cosine = np.minimum(0.5 * np.linalg.norm(i + o, axis=0), 1.0)
        colour = np.stack([np.interp(cosine, steps, channel) for channel in reflectance.T], axis=1)
        return lobe[:, None] * colour

    return brdf


def write_surface(path: str | os.PathLike[str], surface: Surface, *, overwrite: bool = False) -> None:
    """Write a whole surface, its diffuse part and all its lobes, as a `.bsdf` file for Mitsuba.

    **Arguments:** `path` of the file; `surface`, whose three channels become R, G and B and whose free
    numbers take their start values. A surface that is not isotropic gets a table over the azimuth.

    **Raises:** UsageError for another number of channels, a surface that reflects nothing, and where `path`
    exists without `overwrite` or cannot be written.
    """
    if surface.channels != 3:
        raise UsageError(f"a .bsdf has R, G and B: the surface has {surface.channels} wavelengths")

    def brdf(i: np.ndarray, o: np.ndarray) -> np.ndarray:
        ends = [np.rad2deg(each) for vector in (i, o) for each in angles(vector)]
        return simulate_samples(surface, Directions(*ends)).samples.values

    size = ISOTROPIC if _isotropic(brdf) else ANISOTROPIC
    write_tensors(path, tabulate(brdf, size, description=f"surface {surface.model}"), overwrite=overwrite)


def _isotropic(brdf: Brdf) -> bool:
    """True where turning light and viewer together by any azimuth changes nothing."""
    random = np.random.default_rng(0)
    theta, phi = random.uniform(0, 1.4, (2, 256)), random.uniform(0, 2 * np.pi, (3, 256))
    straight, turned = (
        brdf(vectors(theta[0], phi[0] + turn), vectors(theta[1], phi[1] + turn)) for turn in (0.0, phi[2])
    )
    return bool(np.all(np.abs(straight - turned) <= 1e-6 * np.max(np.abs(straight))))


def _reflectances(look: Appearance, nm: np.ndarray, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear sRGB, clipped at 0, and reflectance at `WAVELENGTHS`, (thicknesses, cosines, ...)."""
    bands, to_srgb = integration_bands(BANDS), srgb_matrix(sensor().white)
    degrees, count = np.rad2deg(np.arccos(cosine))[::-1], len(bands.wavelength)
    spectra = look.spectra(np.concatenate([bands.wavelength, WAVELENGTHS]), nm, degrees)
    spectra = np.swapaxes(spectra[::-1], 0, 1)
    rgb = spectra[..., :count] @ bands.weights @ to_srgb.T
    return np.maximum(rgb, 0.0), spectra[..., count:]


TARGET = Target("mitsuba", "Mitsuba", (".xml", ".bsdf"), (), None, write, takes_map=True)
