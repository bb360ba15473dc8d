"""Systematic effects of BRDF samples: their change by each number that a surface takes for granted."""

import math
from typing import Any

import numpy as np

from pellicle.brdf.directions import direction
from pellicle.fitting.brdf.view import Local, Samples, SamplesView, local
from pellicle.fitting.linear_system import HALF_NORMAL, Effect
from pellicle.optics.orders import FWHM
from pellicle.scene.surface import LETTERS, Surface

_STEP = 0.1
"""Finite step of a linear effect, in standard uncertainties."""
_INDICES = {"n": "index of the film", "base_n": "index of the base", "base_k": "extinction of the base"}


def systematic_effects(view: SamplesView, values: np.ndarray, at: Local, surface: Surface) -> list[Effect]:
    """Every effect to which the `surface` gives an uncertainty, at `values` (the parameters of the view,).

    `at` is the local model there. What is free in the surface is no effect.
    """
    allowed, of = surface.uncertainty, f" of {view.name}" if view.name else ""
    numbers = {key: np.asarray(x, float) for key, x in view.form.numbers(values, view.fixed).items()}
    model, rise, every = np.asarray(at.model)[: view.rows], view.slope_of_compared(at), list[Effect]()

    def signal(changed: dict[str, Any], samples: Samples = view.data) -> np.ndarray:
        # by the program of the fit
        at = np.array([changed.pop(key, x) for key, x in zip(view.form.keys, values, strict=True)], float)
        return np.asarray(local(view.form, samples, view.fixed | changed, at).model)[: view.rows]

    def add(name: str, size: float, unit: str, change: np.ndarray, **kind: Any) -> None:
        every.extend([Effect(name, size, unit, rise * change, **kind)] if size else [])

    def slope(higher: np.ndarray, lower: np.ndarray) -> np.ndarray:
        return (higher - lower) / (2 * _STEP)

    for key in [key for key in _INDICES if key in numbers and key not in view.form.keys]:
        size = allowed.index if key == "n" else allowed.base
        ends = (signal({key: numbers[key] * (1 + s * _STEP * size)}) for s in (1, -1))
        add(_INDICES[key], size, "", slope(*ends))
    depth, nm = numbers.get("thickness", np.zeros(())), numbers["wavelengths"]
    widths = [("thickness spread", "thickness", depth, allowed.thickness_spread * float(depth), 1.0)]
    if "weights" not in numbers:
        widths.append(("bandwidth", "wavelengths", nm, allowed.bandwidth, FWHM))
    for name, key, mean, size, by in widths:
        # a normal distribution by three nodes, for a variance of the prior's root mean square
        ends = [signal({key: mean + s * math.sqrt(3) * size / by}) for s in (1, -1)]
        add(name, size, "nm", HALF_NORMAL / 6 * (sum(ends) - 2 * model), power=2)
    for side, name in (("i", "angle of incidence"), ("o", "viewing angle")):
        ends = (signal({}, _turned(view.data, side, s * _STEP * allowed.angle)) for s in (1, -1))
        add(f"{name}{of}", allowed.angle, "deg", slope(*ends), shared=False)
    shifted = slope(*(signal({"wavelengths": nm + s * _STEP * allowed.band}) for s in (1, -1)))
    names = [x.upper() for x in LETTERS] if view.channels == 3 else range(1, view.channels + 1)
    for channel, own in zip(names, np.eye(view.channels), strict=True):
        add(f"gain of {channel}", allowed.gain, "", allowed.gain * model * own)
        add(f"wavelength of {channel}", allowed.band, "nm", shifted * own)
    return every


def _turned(samples: Samples, side: str, degrees: float) -> Samples:
    """The samples with the directions on one side, "i" or "o", further from the normal."""
    x, y, z = np.moveaxis(np.asarray(getattr(samples, side)), -1, 0)
    polar = np.rad2deg(np.arctan2(np.hypot(x, y), z)) + degrees
    return samples._replace(**{side: direction(polar, np.rad2deg(np.arctan2(y, x)), np)})
