"""The measurement that would decide between the hypotheses of an identification."""

from dataclasses import replace

import numpy as np

from pellicle.fitting.measurement_plan import plan_measurement
from pellicle.fitting.planned_measurement import MeasurementPlan
from pellicle.fitting.progress import Progress, quiet
from pellicle.identification.hypothesis import DecidingSignal, Identification
from pellicle.scene.free import free_leaves

MOST = 3
"""Hypotheses, the best first, between which a measurement is to decide."""


def with_next_measurement(found: Identification, progress: Progress = quiet) -> Identification:
    """Return an identification with the measurements that would decide between its best hypotheses, and their
    verdict behind its own; itself where there are not two to decide between.

    The noise is the usual one, and the wavelengths those of the first spectrum.
    """
    scenes = {x.name: x.scene() for x in found.hypotheses[:MOST]}
    scenes = {name: scene for name, scene in scenes.items() if free_leaves(scene)}
    if len(scenes) < 2:
        return found
    nm = np.unique(found.data[0].wavelength)
    plan: MeasurementPlan = plan_measurement(scenes, nm, polarisations=("unpolarised",), progress=progress)
    rows = (m for m in plan.would_decide if m["times"] == 1)
    signals = tuple(DecidingSignal(m["signal"], m["angle"], m["delta_ln_z"]) for m in rows)
    said = plan.verdict[0].upper() + plan.verdict[1:]
    return replace(found, would_decide=signals, verdict=f"{found.verdict} {said}.")
