"""A solid ball under smooth films: what it mirrors, and what is seen through it.

A ray that meets a sphere meets it again and again at one angle and in one plane of incidence, so s and p stay
what they are and their spectra multiply. The film has one thickness over the ball.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pellicle.optics.pair import to_complex
from pellicle.synthetic.environment import Environment
from pellicle.synthetic.film_spectra import Spectra, Stack, linear_srgb, spectra
from pellicle.synthetic.sphere import Rendering, Sphere, sphere

COSINES = 256
"""Nodes of the cosine between which colours are interpolated: within 0.001 of white for films to 1 µm."""
CHORDS = 5
"""Most chords within the ball: under a film that reflects a quarter, further ones have 0.1 % of the light."""
OPAQUE = 1e-4
"""Extinction from which a ball is opaque: 0.2 mm of it then pass less than 60 % at 500 nm."""


class Ball(NamedTuple):
    """Renderings of a ball: in reflection alone, and of the light through it (None if it is opaque)."""

    reflected: Rendering
    transmitted: Rendering | None

    @property
    def whole(self) -> Rendering:
        """Both together."""
        if self.transmitted is None:
            return self.reflected
        return self.reflected._replace(linear=self.reflected.linear + self.transmitted.linear)


def ball(films: Stack, thickness: float, environment: Environment, size: int) -> Ball:
    """Render a ball under a film of this thickness (nm), size × size pixels.

    Colours are integrals of the spectra in steps of 1 nm. Within the ball each ray runs as its refractive
    index at 550 nm bends it: the ball disperses no colours.
    """
    pixels = sphere(size)
    cosine = np.linspace(0.0, 1.0, COSINES + 1)[1:]
    found = spectra(films, thickness, cosine)

    def colour(spectrum: np.ndarray) -> np.ndarray:
        table = linear_srgb(films, spectrum)
        return np.stack([np.interp(pixels.cosine, cosine, channel) for channel in table.T], axis=-1)

    seen = environment.radiance(pixels.mirrored())[:, None]
    reflected = pixels.rendering(colour(found.reflected) * seen)
    if is_opaque(films):
        return Ball(reflected, None)
    return Ball(
        reflected, pixels.rendering(_through(pixels, _relative_index(films), found, environment, colour))
    )


def is_opaque(films: Stack) -> bool:
    """True where the substrate absorbs."""
    return bool(np.max(np.imag(to_complex(films.substrate))) > OPAQUE)


def _relative_index(films: Stack) -> float:
    inside, outside = (
        float(np.interp(550.0, films.eye.wavelength, np.real(to_complex(medium))))
        for medium in (films.substrate, films.ambient)
    )
    return inside / outside


def _through(
    pixels: Sphere,
    index: float,
    found: Spectra,
    environment: Environment,
    colour: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Light (pixels, 3) after one chord, two, ...: T² R′^(chords − 1) of what lies where it leaves."""
    outside = np.arccos(pixels.cosine)
    inside = np.arcsin(np.clip(np.sin(outside) / index, -1.0, 1.0))
    total = np.zeros((len(outside), 3))
    spectrum = found.transmitted**2
    for chord in range(CHORDS):
        turned = 2 * (outside - inside) + chord * (np.pi - 2 * inside)
        total += colour(spectrum) * environment.radiance(pixels.deflected(-turned))[:, None]
        spectrum = spectrum * found.below
    return total
