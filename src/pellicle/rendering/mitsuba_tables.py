"""Tables of a film for Mitsuba: lookups over thickness and cosine, and `.bsdf` files of `measured`."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from pellicle.brdf.lobes import microfacets
from pellicle.colour import integration_bands, sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.data.half_angles import angles, vectors
from pellicle.data.write_rgl import ISOTROPIC, Brdf, TableSize, tabulate
from pellicle.rendering.appearance import Appearance
from pellicle.scene.surface import Surface
from pellicle.synthetic.brdf import Directions, simulate_samples
from pellicle.synthetic.colours import BANDS

WAVELENGTHS = np.arange(380.0, 731.0, 5.0)
"""Wavelengths (nm) of spectral tables; beyond them less than 0.01 % of the light is seen."""
SPECTRAL = TableSize(thetas=32, side=32)
"""Nodes of a spectral `.bsdf` file, which takes every second wavelength: 5 MB."""
ANISOTROPIC = TableSize(33, 24, 32)
"""Nodes of the `.bsdf` file of a surface that is not isotropic: 11 MB."""
_STEP, _FEWEST, _MOST = 0.4, 64, 512
"""Step (nm) between the thicknesses of a lookup, and bounds of their number."""
_COSINES = 64
_FINE = np.linspace(0.0, 1.0, 1001)


@dataclass(frozen=True)
class Lookup:
    """Reflectance of a film over its thickness and the cosine of the angle of incidence, in even steps.

    `rgb` (thicknesses, cosines, 3) is linear sRGB under D65, not clipped: interference colours exceed its
    gamut. `spectra` (thicknesses, cosines, wavelengths) is the reflectance at `WAVELENGTHS`. `thickness` is
    the range and `own` the film's own one, in nm; cosines run from 0 to 1.
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
    return Lookup(_rgb(look, nm, cosine), _spectra(look, WAVELENGTHS, nm, cosine), span, own)


def film_tables(look: Appearance, alpha: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the fields of two `.bsdf` files of an even film on GGX facets, in RGB and spectral."""
    own, text = look.thickness[-1:], f"film of {look.thickness[-1]:.6g} nm on GGX facets, alpha {alpha:g}"
    rgb, spectra = _rgb(look, own, _FINE)[0], _spectra(look, WAVELENGTHS[::2], own, _FINE)[0]
    return (
        tabulate(facets(rgb, alpha), ISOTROPIC, description=text),
        tabulate(facets(spectra, alpha), SPECTRAL, wavelengths=WAVELENGTHS[::2], description=text),
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


def surface_table(surface: Surface) -> dict[str, np.ndarray]:
    """Return the fields of the `.bsdf` file of a surface of three channels, which become R, G and B.

    Free numbers take their start values. A surface that is not isotropic gets a table over the azimuth.
    """

    def brdf(i: np.ndarray, o: np.ndarray) -> np.ndarray:
        ends = [np.rad2deg(each) for vector in (i, o) for each in angles(vector)]
        return simulate_samples(surface, Directions(*ends)).samples.values

    size = ISOTROPIC if _isotropic(brdf) else ANISOTROPIC
    return tabulate(brdf, size, description=f"surface {surface.model}")


def _isotropic(brdf: Brdf) -> bool:
    """True where turning light and viewer together by any azimuth changes nothing."""
    random = np.random.default_rng(0)
    theta, phi = random.uniform(0, 1.4, (2, 256)), random.uniform(0, 2 * np.pi, (3, 256))
    straight, turned = (
        brdf(vectors(theta[0], phi[0] + turn), vectors(theta[1], phi[1] + turn)) for turn in (0.0, phi[2])
    )
    return bool(np.all(np.abs(straight - turned) <= 1e-6 * np.max(np.abs(straight))))


def _rgb(look: Appearance, nm: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Linear sRGB (thicknesses, cosines, 3)."""
    bands, to_srgb = integration_bands(BANDS), TO_SRGB @ adaptation(sensor().white, SRGB_WHITE)
    return _spectra(look, bands.wavelength, nm, cosine) @ bands.weights @ to_srgb.T


def _spectra(look: Appearance, wavelength: np.ndarray, nm: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Reflectance (thicknesses, cosines, wavelengths) at rising cosines."""
    degrees = np.rad2deg(np.arccos(cosine))[::-1]
    return np.swapaxes(look.spectra(wavelength, nm, degrees)[::-1], 0, 1)
