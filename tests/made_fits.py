"""Fits written down by hand, for tests of what is concluded from them and reported."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from pellicle.fitting.result import Estimate, Fit, Part, Status


def made_fit(*parts: Part, parameters: Iterable[Estimate] = (), **more: Any) -> Fit:
    """A converged fit without warnings and correlations, unless `more` says otherwise."""
    named = {p.name: p for p in parameters}
    free = tuple(name for name, p in named.items() if p.free)
    fields = {"status": Status.CONVERGED, "verdict": "", "rivals": (), "warnings": (), "profile": None}
    fields |= {"chi2_reduced": parts[0].chi2_reduced, "rms": parts[0].rms, "seconds": 0.1}
    fields |= {"correlation_names": free, "correlation": np.eye(len(free))}
    points = sum(part.effective_points for part in parts)
    return Fit(parts=parts, parameters=named, effective_points=points, **(fields | more))
