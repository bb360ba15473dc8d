"""Measurements as a fit takes them: a spectrum, colours or BRDF samples, or a list."""

import os
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError

Datum: TypeAlias = Spectrum | Colours | BrdfSamples
Measurement: TypeAlias = Datum | Sequence[Datum]


SHORTEST = 10.0
"""Wavelength in nm that arrays must reach: what ends below it is in µm or eV. Readers of files know units."""


def check_measurement(data: Any) -> None:
    """Raise UsageError unless `data` is a measurement; the message has the call that makes one.

    DataError for wavelengths that are not in nm.
    """
    for each in data if isinstance(data, list | tuple) else [data]:
        if isinstance(each, Spectrum) and not each.path and 0 < np.max(each.wavelength, initial=0) < SHORTEST:
            raise DataError(
                f"`wavelength` ends at {each.wavelength.max():g}, and is in nm: multiply µm by 1000, or"
                " divide 1239.84 by eV"
            )
        if isinstance(each, Spectrum | Colours | BrdfSamples):
            continue
        if isinstance(each, str | os.PathLike):
            path = os.fspath(each)
            raise UsageError(
                f"`data` must be a Spectrum or BrdfSamples, not the path {path!r}: read the file, as in"
                f" pl.read_spectrum({path!r})"
            )
        name, remedy = type(each).__name__, 'arrays make one as in pl.Spectrum(wavelength, values, "R")'
        if name in ("Scene", "Surface"):
            remedy = "the scene comes second, as in pl.fit(data, scene)"
        raise UsageError(
            f"`data` must be a Spectrum, Colours, BrdfSamples or a list of them, not {name}: {remedy}"
        )
