"""Identification of the film in the explorer's data, on the substrate of its scene."""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import jax

from pellicle.data.spectrum import Spectrum
from pellicle.fitting.status import describe
from pellicle.identification import films
from pellicle.identification.hypothesis import Identification, Outcome
from pellicle.identification.identify import identified
from pellicle.identification.request import Request
from pellicle.reporting.identification import report
from pellicle.reporting.json_record import taken
from pellicle.scene.film import Light, Scene

_TONES = {Outcome.IDENTIFIED: "good", Outcome.UNDECIDED: "warn"}
"""Class of the style of an outcome; others are bad."""
BUDGET = 30.0
"""Seconds after which nothing more is tried: the page waits."""


def identification(spectra: Sequence[Spectrum], scene: Scene, values: Mapping[str, float]) -> Identification:
    """Identify the film of spectra below the ambient and on the substrate of a scene.

    Data without an angle of incidence have that of `values` of sliders. Raises as `pellicle.identify` does.
    """
    light = Light(angle=values.get("angle", 0.0))
    names = tuple(films.chosen(None, None))
    request = Request(scene.substrate, scene.ambient, light, names, budget=BUDGET)
    with jax.enable_x64(True):
        return identified(spectra, request, time.perf_counter())


def identification_to_json(found: Identification) -> dict[str, Any]:
    """Convert the verdict and the hypotheses that are left."""
    rows = []
    for x in found.hypotheses:
        numbers = [describe(own) for own in x.parameters.values() if math.isfinite(own.stderr)]
        rows.append(taken(x, "name", "probability") | {"text": ", ".join(numbers)})
    return {
        "status": str(found.status),
        "tone": _TONES.get(found.status, "bad"),
        "verdict": found.verdict,
        "hypotheses": rows,
        "summary": report(found),
    }
