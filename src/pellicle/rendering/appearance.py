"""Exact colours of a film in reflection over the angle, and the numbers that renderers take of it."""

from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from pellicle.colour import integration_bands, sensor
from pellicle.colour.spaces import srgb_matrix
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.optics.pair import parts
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import free_leaves, insert, start_values
from pellicle.scene.instrument import Instrument
from pellicle.scene.layers import Interface, Layer, Plate
from pellicle.simulation.colours import BANDS, interference_colours, interference_spectra, varied_layer

ANGLES = np.linspace(0.0, 80.0, 81)
"""Angles of incidence (degrees) at which colours are compared."""
CHANNELS = np.array([650.0, 550.0, 450.0])
"""Wavelengths (nm) of red, green and blue, at which a renderer's indices per channel are taken."""
OPAQUE = 1e-4
"""Extinction above which a substrate is opaque: visible light enters it by less than half a millimetre."""
_ABSORBED = 1e-3
"""Share of light absorbed in a layer above which it is said to absorb; 200 nm of TiO2 have 8e-5."""
FILM = "film"
"""Name of the layer whose thickness may vary."""


@dataclass(frozen=True)
class Appearance:
    """Exact colours of a film, and the numbers of its one layer and of its substrate.

    `thickness` (thicknesses,) is in nm: one, or several where it varies over the object. `xyz`
    (thicknesses, angles, 3) are the colours at `ANGLES` under D65 for the CIE 1931 observer, Y = 1 for a
    perfect reflector. `layer` and `base` are n + ik at `CHANNELS`, `bare` the linear sRGB of the substrate
    without a layer at normal incidence; of a base with a texture they have its axes in front. `scene` is the
    film in reflection, whose layer is named `FILM`. `roughness` is the GGX α of its facets. `index_free` is
    True where the index of the layer has free numbers, `coherent` for even layers with smooth faces, whose
    light has one phase. `notes` are sentences on what else its colours contain, `lacking` on what no format's
    formula has.
    """

    thickness: Float[np.ndarray, " thicknesses"]
    xyz: Float[np.ndarray, "thicknesses angles 3"]
    layer: np.ndarray
    base: np.ndarray
    bare: Float[np.ndarray, "*texels 3"]
    scene: Scene
    roughness: float = 0.0
    coherent: bool = True
    index_free: bool = False
    notes: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()

    @property
    def metallic(self) -> bool:
        """True where light does not leave the substrate again: a metal or a semiconductor."""
        return bool(np.max(np.imag(self.base)) > OPAQUE)

    @property
    def index(self) -> float:
        """Refractive index of the layer at 550 nm, at least 1 as in all formats: gold has less."""
        return max(float(self.layer[1].real), 1.0)

    def spectra(self, wavelength: np.ndarray, thickness: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Reflectance (angles, thicknesses, wavelengths); wavelengths and thicknesses in nm, degrees."""
        return interference_spectra(self.scene, wavelength, thickness, angle, FILM)


def appearance(scene: Scene, thickness: Any = None, layer: str | None = None) -> Appearance:
    """Compute the exact colours of a scene's film, and collect what renderers take of it.

    **Arguments:** `scene`, whose free parameters take their start values; `thickness` in nm,
    (thicknesses,), of the `layer` of that name (the free one or else the first if None), by default its own.

    **Raises:** UsageError without a coherent layer or for an unknown name, ValueError where a material has
    no data between 380 and 730 nm.
    """
    position = varied_layer(scene, layer)
    film: Any = scene.layers[position]
    index_free = bool(free_leaves(film.material))
    scene = insert(scene, start_values(scene))
    # without what belongs to the measurement, not to the sample
    of_sample = Light(), Instrument(thickness_spread=scene.instrument.thickness_spread)
    scene = eqx.tree_at(lambda s: (s.light, s.instrument), scene, of_sample)
    film = scene.layers[position]
    nm = np.unique(np.asarray(film.thickness if thickness is None else thickness, float))
    # without the others' names, so that it is found by its own
    named = tuple(replace(x, name=FILM if i == position else None) for i, x in enumerate(scene.layers))
    scene = replace(scene, layers=named)
    colour, bands = interference_colours(scene, nm, ANGLES, FILM), integration_bands(BANDS)
    n0, n2 = (index_of(medium, bands.wavelength) for medium in (scene.ambient, scene.substrate.material))
    own, base = (index_of(medium, CHANNELS) for medium in (film.material, scene.substrate.material))
    xyz, left_out = np.swapaxes(np.asarray(colour.xyz), 0, 1), _left_out(scene, film, nm[-1])
    return Appearance(nm, xyz, own, base, bare_colour(n0, n2), scene, index_free=index_free, **left_out)


def bare_colour(above: np.ndarray, base: np.ndarray) -> Float[np.ndarray, "... 3"]:
    """Linear sRGB of a bare face between indices (..., wavelengths) of colours, at normal incidence."""
    reflectance = np.abs((above - base) / (above + base)) ** 2
    xyz = reflectance @ integration_bands(BANDS).weights
    return np.clip(xyz @ srgb_matrix(sensor().white).T, 0.0, 1.0)


def index_of(medium: AbstractDispersion, wavelength: np.ndarray) -> np.ndarray:
    """n + ik at wavelengths in nm."""
    re, im = parts(known_index(medium, wavelength))
    return np.broadcast_to(re + (0j if im is None else 1j * np.asarray(im)), wavelength.shape)


def _left_out(scene: Scene, film: Layer, thickest: float) -> dict[str, Any]:
    """The sentences `notes` and `lacking` of an `Appearance`, and whether it is `coherent`.

    The film is `thickest` nm thick at most.
    """
    instrument, own = scene.instrument, scene.substrate
    coherent = sum(isinstance(x, Layer | Interface) for x in scene.layers)
    plates = own.back is not None or any(isinstance(x, Plate) for x in scene.layers)
    rough = film.roughness is not None or own.roughness is not None
    uneven = film.thickness_spread is not None or instrument.thickness_spread is not None
    notes = {
        "light that returns from the back face of a plate is part of its colours": plates,
        "interfaces with a roughness in nm are part of its colours": rough,
        "the spread of its thickness is part of its colours": uneven,
    }
    absorbs = np.max(4 * np.pi * np.imag(index_of(film.material, CHANNELS)) / CHANNELS) * thickest > _ABSORBED
    immersed = np.max(np.abs(index_of(scene.ambient, CHANNELS) - 1.0)) > 1e-3
    lacking = {
        f"the film has {coherent} layers: formats have one, here {film.name or 'that'} of {thickest:.4g} nm;"
        " the argument layer chooses it": coherent > 1,
        "the layer absorbs: formats have none that does": absorbs,
        "it is not in air, as formats assume": immersed,
    }
    each = {"notes": notes, "lacking": lacking}
    smooth = all(isinstance(x, Layer) and x.repeats == 1 and x.roughness is None for x in scene.layers)
    said = {key: tuple(text for text, holds in texts.items() if holds) for key, texts in each.items()}
    return {"coherent": smooth and not (rough or uneven), **said}
