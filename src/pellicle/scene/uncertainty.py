"""Standard uncertainties of what a scene states, and usual sizes of what it leaves out."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class StandardUncertainties:
    """Standard uncertainties by name, each finite and not negative."""

    def __post_init__(self):
        for field in fields(self):
            check_uncertainty(field.name, getattr(self, field.name))

    @classmethod
    def none(cls) -> Any:
        """Everything stated is exact, and nothing else is there: errors are those of noise and residuals."""
        return cls(**{field.name: 0.0 for field in fields(cls)})


@dataclass(frozen=True)
class Uncertainty(StandardUncertainties):
    """Standard uncertainties of numbers that a scene states, and usual sizes of effects that it leaves out.

    The defaults are those of ordinary instruments and samples. 0 is a number that is known, or an effect that
    is known to be absent. What a scene has as a free parameter, or describes itself, does not count.

    **Arguments:**

    - `wavelength`: of the wavelength scale, in nm.
    - `bandwidth`: full width at half maximum of the spectrometer's window, in nm.
    - `angle`: of the angle of incidence, in degrees; at normal incidence its square counts.
    - `angle_spread`: half angle of the cone of light, in degrees.
    - `scale`: relative, of R and T, and of a slope over the spectrum; a curvature has half of it.
    - `offset`: of R and T, as a fraction.
    - `psi`, `delta`: of offsets of Ψ and Δ, in degrees; `depolarisation`: lost share of polarised light.
    - `mueller`: of an offset of each normalised element of a Mueller matrix.
    - `index`: relative, of every given index but that of a gas; a layer and the substrate may have their own.
    - `dispersion`: relative, of the shape of a dispersion model whose numbers are free.
    - `roughness`: root mean square height of the upper face, in nm.
    - `thickness_spread`: standard deviation of the thickness over the spot, relative (at most 12 nm).
    - `interlayer`: thickness of a native oxide on a substrate of an index above 2, in nm, and twice that of a
      mixture of the media at its face.
    - `overlayer`: thickness of a contamination of index 1.5 on the upper face, in nm.
    - `white_balance`: relative, of the channels of colours; `flare`: light or black level added to them, as
      a share of white; `camera`: exponent of its coding, and where it is not calibrated share of one channel
      in another, and half the error of the saturation; `lamp`: slope and curvature of its spectrum, relative.

    **Raises:** ValueError for a negative or infinite number.

    >>> Uncertainty(wavelength=0.1).index
    0.005
    """

    wavelength: float = 0.5
    bandwidth: float = 2.0
    angle: float = 0.05
    angle_spread: float = 2.0
    scale: float = 0.01
    offset: float = 0.005
    psi: float = 0.05
    delta: float = 0.15
    depolarisation: float = 0.005
    mueller: float = 0.002
    index: float = 0.005
    dispersion: float = 0.003
    roughness: float = 1.5
    thickness_spread: float = 0.01
    interlayer: float = 1.0
    overlayer: float = 0.5
    white_balance: float = 0.02
    flare: float = 0.01
    camera: float = 0.05
    lamp: float = 0.1


def check_uncertainty(name: str, value: float | None) -> None:
    """Raise ValueError for a negative or infinite uncertainty."""
    if value is not None and not 0 <= value < math.inf:
        raise ValueError(f"the uncertainty of `{name}` must be finite and not negative, got {value:g}")
