"""One fit at a time: the scene of the sliders fitted to data, with progress, and stopped on request."""

import math
import threading
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.explorer.controls import Control
from pellicle.explorer.dropped_files import lines
from pellicle.explorer.programs import Curve, measured_angles
from pellicle.fitting.curves import Curve as FittedCurve
from pellicle.fitting.film.fit import fit
from pellicle.fitting.result import Fit
from pellicle.reporting import fit_text
from pellicle.scene.film import Scene


class _Stopped(Exception):
    """A fit whose result is no longer wanted."""


class FitRun:
    """The fit that is running, and its progress."""

    def __init__(self) -> None:
        self._running, self._stop = threading.Lock(), threading.Event()
        self._progress = ("", 0, 0)

    def run(self, data: Sequence[Spectrum], scene: Scene) -> Fit | None:
        """Fit a scene to spectra; None where it was stopped. Raises UsageError while another fit runs."""
        if not self._running.acquire(blocking=False):
            raise UsageError("a fit is running: stop it, or wait for its result")
        try:
            self._stop.clear()
            return fit(data[0] if len(data) == 1 else list(data), scene, progress=self._report)
        except _Stopped:
            return None
        finally:
            self._progress = ("", 0, 0)
            self._running.release()

    def status(self) -> dict[str, Any]:
        """Return the stage of the fit in numbers and words."""
        stage, done, total = self._progress
        text = f"{stage} {done}/{total}" if total > 1 else stage
        return {"running": self._running.locked(), "stage": stage, "done": done, "total": total, "text": text}

    def stop(self) -> dict[str, Any]:
        """End the fit at its next step."""
        self._stop.set()
        return {"running": self._running.locked()}

    def _report(self, stage: str, done: int, total: int) -> None:
        self._progress = (stage, done, total)
        if self._stop.is_set():
            raise _Stopped


def fitted_names(controls: Collection[Control], asked: Any) -> list[str]:
    """Names of the controls to fit: those that are `asked`, else the scene's free ones, else thicknesses.

    Raises UsageError for an unknown name.
    """
    if asked is not None:
        known = {control.name for control in controls}
        if not isinstance(asked, list | tuple) or not asked or not all(name in known for name in asked):
            raise UsageError(f"`free` must be a list of one or more of {', '.join(sorted(known))}")
        return list(asked)
    free = [control.name for control in controls if control.free is not None]
    return free or [control.name for control in controls if control.path[-1].name == "thickness"]


def to_json(fit: Fit, controls: Collection[Control]) -> dict[str, Any]:
    """Convert a fit: values and standard errors of controls, verdict, report and fitted curves."""
    values, errors = {}, {}
    for control in controls:
        estimate = fit.parameters.get(control.name)
        if estimate is not None and estimate.free:
            values[control.name] = min(max(estimate.value, control.lower), control.upper)
            errors[control.name] = estimate.stderr if math.isfinite(estimate.stderr) else None
    return {
        "values": values,
        "errors": errors,
        "status": str(fit.status),
        "verdict": fit.verdict.replace("`", ""),
        "warnings": [warning.replace("`", "") for warning in fit.warnings],
        "summary": fit_text.report(fit).replace("`", ""),
    }


def fitted_curves(fit: Fit, against_angle: bool = False) -> list[Curve]:
    """Return the fitted signal of each spectrum, with its scale and offset, as `data_curves` does data."""
    curves = []
    every = measured_angles([part.spectrum for part in fit.parts])
    for part in fit.parts:
        curve = part.curve
        if isinstance(curve, FittedCurve) and np.ndim(curve.model) == 1:
            quantities = [q for q in part.spectrum.kind.quantities if q.array != "depolarisation"]
            columns = {q.symbol: q.curve(curve)[1] for q in quantities}
            for rows, x, setting in lines(part.spectrum, every, against_angle):
                for label, y in columns.items():
                    curves.append(Curve(label, x, y[rows], setting, part.spectrum.name))
    return curves
