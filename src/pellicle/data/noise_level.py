"""Standard deviation of noise as users write it: 0.01, or "2 %" of the signal."""

import math
from typing import NamedTuple

from pellicle.errors import UsageError


class NoiseLevel(NamedTuple):
    """A standard deviation in the unit of the signal, or where `relative` as a share of the signal."""

    value: float
    relative: bool = False

    def __str__(self) -> str:
        return f"{100 * self.value:g} %" if self.relative else f"{self.value:g}"


def noise_level(value: float | str, name: str = "`noise`") -> NoiseLevel:
    """Return the noise level of a number, or of a text such as "0.01" or "2 %".

    Raises UsageError, with `name` in front, unless it is a finite number above zero.
    """
    text = str(value).strip()
    relative = text.endswith("%")
    try:
        number = float(text.removesuffix("%"))
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise UsageError(
            f"{name} must be a standard deviation above zero, as in 0.01, or a share of the signal, "
            f"as in '2 %', not {text!r}"
        )
    return NoiseLevel(number / 100 if relative else number, relative)
