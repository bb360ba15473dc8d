"""Colour spaces: XYZ, linear sRGB, sRGB and Lab, colour differences, colours outside sRGB, and encodings.

An `Encoding` describes a space in which colours are measured as a function of the exposure. In every space a
channel is a power of the exposure above a cut, and linear below. So the exposure of a colour in a known
direction is found by linear regression, and a model is exposed without raising its channels to another power.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.optics.pair import namespace

TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""XYZ to linear sRGB (IEC 61966-2-1)."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
SRGB_WHITE = np.linalg.solve(TO_SRGB, np.ones(3))
LUMINANCE = np.linalg.inv(TO_SRGB)[1]
"""Y of linear red, green and blue."""


def adaptation(source: Any, target: Any) -> np.ndarray:
    """Return the Bradford matrix that converts XYZ under the white `source` to that under `target`."""
    gain = (BRADFORD @ np.asarray(target)) / (BRADFORD @ np.asarray(source))
    return np.linalg.solve(BRADFORD, gain[:, None] * BRADFORD)


def srgb_matrix(white: Any) -> np.ndarray:
    """Return the matrix (3, 3) from XYZ under a `white` (3,), which becomes (1, 1, 1), to linear sRGB."""
    return TO_SRGB @ adaptation(white, SRGB_WHITE)


def linear_srgb(xyz: Any, white: Any) -> Float[Array, "... 3"]:
    """Convert XYZ (..., 3) to linear sRGB, not clipped.

    Bradford's adaptation maps `white` (3,) to (1, 1, 1).
    """
    return xyz @ jnp.asarray(srgb_matrix(white).T, jnp.result_type(xyz))


def srgb(linear: Any) -> Float[Array, "..."]:
    """Convert linear sRGB to display values (IEC 61966-2-1), clipped to 0 to 1."""
    linear = jnp.clip(linear, 0.0, 1.0)
    dark = linear <= 0.0031308
    safe = jnp.where(dark, 1.0, linear)
    return jnp.where(dark, 12.92 * linear, 1.055 * safe ** (1 / 2.4) - 0.055)


def lab(xyz: Any, white: Any) -> Float[Array | np.ndarray, "... 3"]:
    """Convert XYZ (..., 3) to CIE 1976 L*, a*, b* relative to `white` (3,); arrays of NumPy stay so."""
    xp = namespace(xyz)
    t = xyz / xp.asarray(white, xp.result_type(xyz))
    dark = t <= (6 / 29) ** 3
    f = xp.where(dark, t * (29 / 6) ** 2 / 3 + 4 / 29, xp.cbrt(xp.where(dark, 1.0, t)))
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return xp.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def delta_e76(one: Any, other: Any) -> Float[Array | np.ndarray, "..."]:
    """Return ΔE*ab (CIE 1976) of Lab values (..., 3); arrays of NumPy stay so.

    It is differentiable; where equal, its gradient is 0.

    >>> float(delta_e76([50.0, 3.0, 4.0], [50.0, 0.0, 0.0]))
    5.0
    """
    xp = namespace(one, other)
    square = xp.sum((xp.asarray(one) - xp.asarray(other)) ** 2, axis=-1)
    equal = square == 0
    return xp.where(equal, 0.0, xp.sqrt(xp.where(equal, 1.0, square)))


def delta_e2000(one: Any, other: Any) -> np.ndarray:
    """Return ΔE CIE 2000 of Lab values (..., 3), by colour-science; it is not differentiable.

    **Raises:** ImportError if colour-science is not installed.
    """
    try:
        from colour.difference import delta_E_CIE2000
    except ImportError as error:
        raise ImportError(
            "ΔE2000 needs colour-science: pip install 'pellicle[colour]' (in a clone of the repository:"
            " pip install -e '.[colour]')"
        ) from error
    return np.asarray(delta_E_CIE2000(np.asarray(one, float), np.asarray(other, float)))


def into_srgb(linear: np.ndarray) -> np.ndarray:
    """Bring linear sRGB into 0 to 1 by mixing each colour outside with the grey of its own luminance.

    Luminance is kept, and hue along a straight line to the white; only saturation is lost. Colours brighter
    than white become white. Clipping each channel would change hue and luminance: a saturated green film
    would look lighter than it is, an overexposed straw yellow.

    **Arguments:** `linear` (..., 3), with 1 for white.

    **Returns:** (..., 3), in 0 to 1; colours inside are unchanged.

    >>> into_srgb(np.array([0.5, 0.5, -0.1])).round(3).tolist()
    [0.455, 0.455, 0.0]
    """
    linear = np.asarray(linear, float)
    grey = np.clip(linear @ LUMINANCE, 0.0, 1.0)[..., None]
    away = linear - grey
    room = np.where(away > 0, 1 - grey, grey)
    share = np.min(np.where(np.abs(away) > room, room / np.maximum(np.abs(away), 1e-300), 1.0), axis=-1)
    return np.clip(grey + share[..., None] * away, 0.0, 1.0)  # the clip removes rounding


def outside(linear: np.ndarray) -> np.ndarray:
    """True where a colour (..., 3) lies outside sRGB by more than 0.001 of white."""
    return np.any((np.asarray(linear) < -1e-3) | (np.asarray(linear) > 1 + 1e-3), axis=-1)


SPACES = ("srgb", "linear-rgb", "xyz", "lab")


class Encoding(NamedTuple):
    """Coded = mix · f(linear · XYZ) + shift, with f(v) = gain·v^power − offset above `cut`, else linear."""

    linear: np.ndarray  # (3, 3)
    power: float
    gain: float = 1.0
    offset: float = 0.0
    cut: float = -np.inf
    slope: float = 1.0
    intercept: float = 0.0
    mix: np.ndarray = np.eye(3)
    shift: np.ndarray = np.zeros(3)
    clips: bool = False  # to 0 and 1

    @property
    def base(self) -> np.ndarray:
        """Coded colour (3,) from which bright colours are proportional to the gain."""
        return self.shift - self.offset * self.mix.sum(axis=1)

    def channels(self, xyz: Any) -> np.ndarray:
        """Linear channels (..., 3) of XYZ."""
        return np.asarray(xyz) @ self.linear.T

    def encode(
        self, channels: np.ndarray, roots: np.ndarray, gain: Any = 1.0, highest: float = 1.0
    ) -> np.ndarray:
        """Coded colours (..., 3) of linear channels, whose `roots` are known, at the exposure gain^(1/power).

        sRGB is clipped to 0 and `highest`.
        """
        gain = np.asarray(gain)[..., None]
        bright = self.gain * gain * roots - self.offset
        if self.cut > -np.inf:
            exposed = gain ** (1 / self.power) * channels
            bright = np.where(exposed <= self.cut, self.slope * exposed + self.intercept, bright)
        coded = bright @ self.mix.T + self.shift if self.mix is not _PLAIN else bright
        return np.clip(coded, 0.0, highest) if self.clips else coded

    def roots(self, channels: np.ndarray) -> np.ndarray:
        """The channels (..., 3) to the power of the space."""
        return channels if self.power == 1 else np.clip(channels, 0.0, None) ** self.power

    def decode(self, coded: np.ndarray) -> np.ndarray:
        """XYZ (..., 3) of coded colours."""
        return self.decoded(coded) @ np.linalg.inv(self.linear).T

    def decoded(self, coded: np.ndarray) -> np.ndarray:
        """Linear channels (..., 3) of coded colours."""
        value = (np.asarray(coded, float) - self.shift) @ np.linalg.inv(self.mix).T
        if self.power == 1:
            return value
        bright = (np.clip(value + self.offset, 0.0, None) / self.gain) ** (1 / self.power)
        dark = (value - self.intercept) / self.slope
        return np.where(dark <= self.cut, dark, bright)

    def rise(self, channels: np.ndarray) -> np.ndarray:
        """∂ coded / ∂ linear channel at linear channels (..., 3): (..., 3, 3), coded by linear."""
        channels = np.asarray(channels, float)
        above = np.maximum(channels, max(self.cut, _LEAST))
        bright = self.gain * self.power * above ** (self.power - 1)
        return self.mix * np.where(channels <= self.cut, self.slope, bright)[..., None, :]


_LEAST = 1e-4
"""Linear channel below which a power without a linear part is taken to rise no faster."""

_PLAIN = Encoding._field_defaults["mix"]


def camera_encoding(gamma: float = 1.0) -> Encoding:
    """Return the encoding of a camera's own channels: to the power 1/`gamma`, from 0 to 1."""
    return Encoding(np.eye(3), 1 / gamma, clips=True)


def encoding(space: str, white: Any) -> Encoding:
    """Return the encoding of a colour space by its name, one of `SPACES`, for XYZ relative to `white` (3,).

    **Raises:** ValueError for another name.
    """
    white = np.asarray(white, float)
    rgb = srgb_matrix(white)
    match space:
        case "srgb":
            return Encoding(rgb, 1 / 2.4, 1.055, 0.055, 0.0031308, 12.92, clips=True)
        case "linear-rgb":
            return Encoding(rgb, 1.0)
        case "xyz":
            return Encoding(np.eye(3), 1.0)
        case "lab":
            mix = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]])
            shift = np.array([-16.0, 0.0, 0.0])
            cut, slope = (6 / 29) ** 3, (29 / 6) ** 2 / 3
            return Encoding(np.diag(1 / white), 1 / 3, 1.0, 0.0, cut, slope, 4 / 29, mix, shift)
    raise ValueError(f"colour space {space!r} is unknown: expected one of {', '.join(SPACES)}")


def measured_encoding(space: str, white: Any, gamma: float = 1.0, matrix: Any = None) -> Encoding:
    """Return the encoding of measured colours, as `encoding`, or of a camera's own channels, "rgb".

    `matrix` (3, 3) gives a camera's linear channels from XYZ; None divides each channel by its white.
    """
    if space != "rgb":
        return encoding(space, white)
    linear = np.diag(1 / white) if matrix is None else np.asarray(matrix)
    return camera_encoding(gamma)._replace(linear=linear)
