"""Tables of a film for Mitsuba: lookups over thickness and cosine, and `.bsdf` files of `measured`."""

import os
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from pellicle.brdf.lobes import microfacets
from pellicle.colour import integration_bands, sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.data.half_angles import angles, vectors
from pellicle.data.write_rgl import ISOTROPIC, Brdf, TableSize, tabulate, write_rgl
from pellicle.errors import UsageError
from pellicle.rendering.appearance import Appearance
from pellicle.scene.surface import Surface
from pellicle.simulation.brdf import Directions, simulate_samples
from pellicle.simulation.colours import BANDS

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
    write_rgl(path, tabulate(brdf, size, description=f"surface {surface.model}"), overwrite=overwrite)


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
    bands, to_srgb = integration_bands(BANDS), TO_SRGB @ adaptation(sensor().white, SRGB_WHITE)
    degrees, count = np.rad2deg(np.arccos(cosine))[::-1], len(bands.wavelength)
    spectra = look.spectra(np.concatenate([bands.wavelength, WAVELENGTHS]), nm, degrees)
    spectra = np.swapaxes(spectra[::-1], 0, 1)
    rgb = spectra[..., :count] @ bands.weights @ to_srgb.T
    return np.maximum(rgb, 0.0), spectra[..., count:]
