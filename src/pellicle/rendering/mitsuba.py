"""Mitsuba 3: tabulated `.bsdf` files of the built-in `measured`, a lookup for a BSDF in Python, and scenes.

Beside `film.bsdf` (RGB) and `film_spectral.bsdf` there are `film.npz` with the lookup over thickness and
cosine, `pellicle_film.py`, the BSDF that reads it, and two scenes of a sphere: `film.xml` by `measured`,
which needs no Python, and `film_lookup.xml` by the lookup, whose thickness may vary over the surface.
"""

import os
from collections.abc import Mapping, Sequence
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
from pellicle.colour.observers import Sensor
from pellicle.colour.spaces import srgb_matrix
from pellicle.data.brdf_samples import angles, vectors
from pellicle.data.formats.rgl import write_tensors
from pellicle.data.rgl_tables import ISOTROPIC, Brdf, TableSize, tabulate
from pellicle.dispersion.base import known_index
from pellicle.errors import UsageError
from pellicle.files import replacing, write_text
from pellicle.optics.pair import to_complex
from pellicle.rendering.appearance import FILM, Appearance
from pellicle.rendering.targets import Material, Target
from pellicle.rendering.textures import share_of_range, write_image
from pellicle.scene.layers import Layer
from pellicle.scene.surface import Surface
from pellicle.simulation.brdf import Directions, simulate_samples
from pellicle.simulation.colours import BANDS
from pellicle.simulation.film_sphere import Stack, mueller_elements, stack

ALPHA = 0.1
"""GGX roughness of a film that has none of its own: `measured` has no perfect mirrors."""
PLUGIN = "pellicle_film"


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write tables, plugin and scenes beside each other, the tables alone for a `.bsdf`.

    A film with a texture has no `.bsdf`, whose directions are those of one thickness and roughness.
    """
    look = material.look
    maps = {"map": material.thickness_map, "roughness": material.roughness_map}
    uneven = [key for key, values in maps.items() if values is not None]
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
            write_image(chosen["map"], share_of_range(nm))
        if "roughness" in chosen:
            write_image(chosen["roughness"], np.asarray(material.roughness_map))
        scene = {
            "comment": f"import {PLUGIN} and call its register() first, see there",
            "table": chosen["lookup"].name,
            "alpha": f"{alpha:g}",
            **{key: chosen[key].name if key in chosen else "" for key in maps},
            "least": f"{np.min(nm):.6g}",
            "largest": f"{np.max(nm):.6g}",
        }
        write_text(chosen["scene"], _scene(scene))
    if "measured" in chosen:
        note = f"mitsuba -m scalar_rgb {path.name}; in spectral variants -D table={chosen['spectral'].name}"
        scene = {"comment": note, "measured": True, "table": chosen["rgb"].name}
        write_text(chosen["measured"], _scene(scene))
    return tuple(chosen.values())


def _paths(path: Path, uneven: Sequence[str]) -> dict[str, Path]:
    """The files that are written, by what they are; `uneven` are the keys of textures."""
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
            raise UsageError(
                f"{path}: a .bsdf has one thickness and one roughness; export a map of them as .xml"
            )
        names = {key: names[key] for key in ("rgb", "spectral")}
    elif uneven:
        images = {"map": f"{path.stem}_thickness.png", "roughness": f"{path.stem}_roughness.png"}
        names = names | images | {"scene": names["measured"]}
        names = {key: names[key] for key in ("lookup", *uneven, "plugin", "scene")}
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
"""Even steps of √cos θ: films of 43 nm on steel and of 150 nm on glass are within 4e-4, in even steps of cos
θ within 2e-3. A film of 1 µm is within 0.04 (mean 0.002), limited by `WAVELENGTHS`."""
OWN_WAVELENGTHS = np.arange(380.0, 731.0, 2.0)
"""Wavelengths (nm) at the film's own thickness."""
_OWN_COSINES = 128
"""Steps of √cos θ there: of films of 1 µm elements are within 1.4e-3 on glass (mean 1.2e-4) and 5e-3 on steel
(4e-4); of a soap film, which is dark near its minima, within 0.014 (1.4e-4). Twice as fine a table takes a
fifth more time, as it exceeds the caches."""
_FINE = np.linspace(0.0, 1.0, 1001)
INDEX_STEP = 0.1
"""Difference of index of the two films between which the lookup of a film of free index interpolates."""


@dataclass(frozen=True)
class Lookup:
    """Light that a film returns and passes over its thickness and the root of the cosine, in even steps.

    `sides` has a table of reflection "" and, of a film on a transparent base, of transmission "_transmitted"
    and of reflection from below "_below", each (thicknesses, cosines, wavelengths, elements): the sensor's
    wavelengths first, then `WAVELENGTHS`; elements m11 and, for coherent layers, m12, m33 and m34 of the
    Mueller matrix. Cosines are those outside the base, whose root runs from 0 to 1; that of "_below" from −1,
    where −2/π · arcsin √((a² − 1)/(η² − 1)), of the transverse index a, stands for totally reflected
    light: its phase is smooth at both ends. `changed` has the same of a film whose index is larger by
    `INDEX_STEP`, where that of the scene's film has free numbers. `fine` has the same at the film's own
    thickness and `OWN_WAVELENGTHS`, in finer steps. `thickness` is the range and `own` the film's own one, in
    nm; `eta` the relative index of a transparent base at 550 nm, or 0. `media` are n of the ambient medium, n
    and k of the film and of the base at `OWN_WAVELENGTHS`. Of a film that is `alone`, `sides` and `changed`
    have the sensor's wavelengths only: its waves are computed by Airy's formula from `media`.
    """

    sides: dict[str, Float[np.ndarray, "thicknesses cosines wavelengths elements"]]
    changed: dict[str, Float[np.ndarray, "thicknesses cosines wavelengths elements"]]
    media: Float[np.ndarray, "own_wavelengths 5"]
    alone: bool
    fine: dict[str, Float[np.ndarray, "own_cosines own_wavelengths elements"]]
    thickness: tuple[float, float]
    own: float
    eta: float

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays by name, as `mitsuba_plugin` reads them.

        `rgb` is linear sRGB under D65, clipped below at 0 where interference colours exceed its gamut:
        Mitsuba drops negative samples.
        """
        arrays: dict[str, Any] = {"wavelength": WAVELENGTHS, "thickness": np.array(self.thickness)}
        arrays |= {"default_thickness": np.array(self.own), "eta": np.array(self.eta)}
        arrays |= {"media": self.media, "alone": np.array(self.alone), "index_step": np.array(INDEX_STEP)}
        for side, values in self.fine.items():
            arrays[f"own_spectra{side}"] = values[..., 0].astype(np.float32)
            if values.shape[-1] > 1 and not self.alone:
                arrays[f"own_mueller{side}"] = values[..., 1:].astype(np.float32)
        for kind, sides in (("", self.sides), ("changed_", self.changed)):
            for side, values in sides.items():
                rgb, spectra = _colours(values[..., 0])
                arrays[f"{kind}rgb{side}"] = rgb.astype(np.float32)
                if self.alone:
                    continue
                arrays[f"{kind}spectra{side}"] = spectra.astype(np.float32)
                if values.shape[-1] > 1:
                    polarised = values[:, :, -len(WAVELENGTHS) :, 1:]
                    arrays[f"{kind}mueller{side}"] = polarised.astype(np.float16)  # of 1: within 2.5e-4
        return arrays


def lookup(look: Appearance) -> Lookup:
    """Tabulate a film from thickness 0 to a quarter above its own (the largest of an uneven film)."""
    own = float(look.thickness[-1])
    span = (0.0, 1.25 * own if own > 0 else 1.0)
    nm = np.linspace(*span, int(np.clip(np.ceil(span[1] / _STEP), _FEWEST, _MOST)))
    media = _media(look)
    alone = look.coherent and len(look.scene.layers) == 1
    wavelength = np.empty(0) if alone else WAVELENGTHS
    sides, eta = _sides(look, nm, _COSINES, wavelength)
    changed: dict[str, np.ndarray] = {}
    if look.index_free and look.coherent:
        changed, _ = _sides(look, nm, _COSINES, wavelength, INDEX_STEP)
    fine, _ = _sides(look, np.array([own]), _OWN_COSINES, OWN_WAVELENGTHS)
    at_own = {side: x[0, :, -len(OWN_WAVELENGTHS) :] for side, x in fine.items()}
    return Lookup(sides, changed, media, alone, at_own, span, own, eta)


def _media(look: Appearance) -> np.ndarray:
    """Indices of the film and of the media around it: see `Lookup`."""
    [layer] = [x for x in look.scene.layers if isinstance(x, Layer) and x.name == FILM]
    found = [look.scene.ambient, layer.material, look.scene.substrate.material]
    n0, film, base = (
        to_complex(known_index(x, OWN_WAVELENGTHS)) * np.ones(len(OWN_WAVELENGTHS)) for x in found
    )
    base = base if look.metallic else np.real(base)
    return np.stack([np.real(n0), *(part(x) for x in (film, base) for part in (np.real, np.imag))], axis=1)


def _sides(
    look: Appearance, nm: np.ndarray, cosines: int, wavelength: np.ndarray, step: float = 0.0
) -> tuple[dict[str, np.ndarray], float]:
    """`sides` and `eta` of a lookup at thicknesses, so many cosines, and `_wavelengths`.

    The index of the film is larger by a `step`.
    """
    # not 0, where a film of thickness 0 between equal media has no limit
    cosine = np.maximum(np.linspace(0.0, 1.0, cosines) ** 2, 1e-6)
    every = _wavelengths(wavelength)
    if not look.coherent:
        return {"": _reflectances(look, nm, cosine, wavelength)[..., None]}, 0.0
    films = stack(look.scene, FILM, eye=Sensor(every, np.empty(0)))
    layers: list[Any] = list(films.layers)
    layers[films.varied] += step
    films = films._replace(layers=tuple(layers))
    n0, n2 = (np.asarray(np.real(to_complex(x)), float) for x in (films.ambient, films.substrate))
    bands = len(every) - len(wavelength)
    above, eta = (float(np.interp(550.0, every[:bands], x[:bands])) for x in (n0, n2 / n0))
    if not look.metallic:  # light from below would gain energy at grazing incidence in a base that absorbs
        films = films._replace(substrate=n2)
    films, n2 = _in_constant_ambient(films, n0, above), n2 * above / n0
    both = mueller_elements(films, nm[:, None], above * np.sqrt(1 - cosine**2))
    both = np.moveaxis(both, 1, -1)
    if look.metallic or eta < 1:
        return {"": both[0]}, 0.0
    beyond = np.sin(0.5 * np.pi * np.sqrt(cosine[:0:-1]))
    square = np.concatenate([1 + beyond**2 * (eta**2 - 1), 1 - cosine**2])
    transverse = np.minimum(
        above * np.sqrt(square), (1 - 1e-7) * np.min(n2)
    )  # nearer to it thick layers give NaN
    reversed_films = films._replace(
        ambient=films.substrate,
        layers=films.layers[::-1],
        substrate=films.ambient,
        thickness=films.thickness[::-1],
        varied=len(films.layers) - 1 - films.varied,
    )
    below = np.moveaxis(mueller_elements(reversed_films, nm[:, None], transverse)[0], 0, -1)
    return {"": both[0], "_transmitted": both[1], "_below": below}, eta


def _in_constant_ambient(films: Stack, n0: np.ndarray, index: float) -> Stack:
    """Films in an ambient medium of one `index`, equivalent to films in n0 (wavelengths,).

    Waves depend on ratios of indices, and of indices to the wavelength, alone. The transverse index of an
    angle is then the same at all wavelengths.
    """
    scale = index / n0
    layers, substrate = jax.tree.map(lambda part: part * scale, (films.layers, films.substrate))
    eye = films.eye._replace(wavelength=films.eye.wavelength * scale)
    return films._replace(eye=eye, ambient=np.full_like(n0, index), layers=layers, substrate=substrate)


def film_tables(look: Appearance, alpha: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the fields of two `.bsdf` files of an even film on GGX facets, in RGB and spectral."""
    own, text = look.thickness[-1:], f"film of {look.thickness[-1]:.6g} nm on GGX facets, alpha {alpha:g}"
    rgb, spectra = (values[0] for values in _colours(_reflectances(look, own, _FINE)))
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


def _wavelengths(others: np.ndarray) -> np.ndarray:
    """Wavelengths (nm) of the sums of colours, then others."""
    return np.concatenate([integration_bands(BANDS).wavelength, others])


def _reflectances(
    look: Appearance, nm: np.ndarray, cosine: np.ndarray, wavelength: np.ndarray = WAVELENGTHS
) -> np.ndarray:
    """Reflectance (thicknesses, cosines, wavelengths) at `_wavelengths`."""
    degrees = np.rad2deg(np.arccos(cosine))[::-1]
    return np.swapaxes(look.spectra(_wavelengths(wavelength), nm, degrees)[::-1], 0, 1)


def _colours(spectra: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear sRGB, clipped at 0, and the spectra at `WAVELENGTHS`, of spectra at `_wavelengths`."""
    bands, to_srgb = integration_bands(BANDS), srgb_matrix(sensor().white)
    count = len(bands.wavelength)
    return np.maximum(spectra[..., :count] @ bands.weights @ to_srgb.T, 0.0), spectra[..., count:]


TARGET = Target("mitsuba", "Mitsuba", (".xml", ".bsdf"), (), None, write, takes_map=True)
