"""Range of the wavelengths at which every medium of a scene is known, and the points of spectra within it."""

from typing import Any, TypeVar

from pellicle.data.spectrum import Spectrum, within
from pellicle.materials import ROUNDING, common_range, limits

Datum = TypeVar("Datum")


def covered(data: Datum, scenes: Any) -> Datum:
    """Leave out the points of a spectrum at which a material of one or several scenes has no data.

    A note of the spectrum states the common range. All points stay where less than half would remain, which
    a simulation then refuses; data of another kind are returned as they are.
    """
    if not isinstance(data, Spectrum):
        return data
    low, high = common_range(scenes)
    return within(data, (low - ROUNDING, high + ROUNDING), limits(scenes, data.wavelength))
