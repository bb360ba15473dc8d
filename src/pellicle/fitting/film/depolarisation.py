"""Measured depolarisation that a scene cannot explain, since nothing in it depolarises light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.noise import local_noise

_CHANCE = 5.0
"""Standard errors by which a mean square must exceed that of the noise."""


def unexplained(
    data: Sequence[Spectrum | Colours], spectra: Sequence[Any], views: Sequence[Any]
) -> list[str]:
    """A sentence for each spectrum with a depolarisation beyond its noise and the scene's uncertainty, where
    the scene has none."""
    sentences = []
    for spectrum, measured, view in zip(data, spectra, views, strict=True):
        if (
            not isinstance(spectrum, Spectrum)
            or spectrum.depolarisation is None
            or view.signal.depolarisation
        ):
            continue
        if spectrum.depolarisation_sigma is None:
            parts = [local_noise(spectrum.depolarisation[rows]) for rows in view.sweeps()]
            noise = math.sqrt(np.mean(np.concatenate(parts) ** 2))
        else:
            noise = math.sqrt(np.mean(spectrum.depolarisation_sigma**2))
        mean_square = float(np.mean(spectrum.depolarisation**2))
        by_chance = 1 + _CHANCE * math.sqrt(2 / len(spectrum))
        excess = math.sqrt(max(mean_square - by_chance * noise**2, 0.0))
        if excess > measured.scene.uncertainty.depolarisation:
            own = f"{view.name}: " if view.name else ""
            sentences.append(
                f"{own}the measured depolarisation (rms {math.sqrt(mean_square):.2g}, noise {noise:.1g}) is"
                " left out, since the scene has none: `thickness_spread`, `bandwidth`, `angle_spread` or a"
                ' back face (`back="air"`) would cause it'
            )
    return sentences
