"""Colour spaces in which colours are measured, as functions of the exposure.

In every space a channel is a power of the exposure above a cut, and linear below. So the exposure of a colour
in a known direction is found by linear regression, and a model is exposed without raising its channels to
another power.
"""

from typing import Any, NamedTuple

import numpy as np

from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation

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
    rgb = TO_SRGB @ adaptation(white, SRGB_WHITE)
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
