"""Compiled functions of the numbers of a film: spectrum, colour, and colours against the angle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import integration_bands
from pellicle.data.mueller import ELEMENTS
from pellicle.effects.film import exact
from pellicle.explorer.controls import Control, template, with_value
from pellicle.optics.ellipsometry import psi_delta
from pellicle.scene.film import Light, Scene, with_wavelength
from pellicle.scene.free import Free, free_leaves, insert, start_values
from pellicle.scene.instrument import Drift, Instrument
from pellicle.scene.layers import Layer
from pellicle.simulation.film import build, tabulated
from pellicle.synthetic.colours import BANDS

COSINES = 256
"""Nodes of the cosine of the angle of incidence: colours between them are within 0.001 of white."""
_OF_THE_INSTRUMENT = ("thickness_spread", "plate_mm", "back_collected", "back")
"""Numbers of layers and substrate that a ball does not have."""

Numbers = Mapping[str, float]
"""Values of controls by name."""


class Curve(NamedTuple):
    """One curve of a plot."""

    label: str
    x: np.ndarray
    y: np.ndarray


def spectrum_program(
    scene: Scene, names: Sequence[str], wavelength: np.ndarray
) -> Callable[[Numbers], list[Curve]]:
    """Compile the spectrum of a scene at wavelengths in nm, as a function of its free numbers `names`.

    A free scale is 1 and a free offset 0. **Raises:** ValueError where a material has no data.
    """
    scale, offset, signal = scene.instrument.scale, scene.instrument.offset, scene.light.signal
    gain = 1.0 if isinstance(scale, Drift) else float(scale)
    shift = 0.0 if isinstance(offset, Drift) else float(offset)
    labels = {"psi-delta": ("Ψ", "Δ"), "mueller": ELEMENTS}.get(signal, (signal,))

    def rows(found: Any) -> Any:
        if signal == "psi-delta":
            return jnp.stack(jnp.broadcast_arrays(*psi_delta(*found.reshape(-1, 3).T)))
        if signal == "mueller":
            return found.reshape(len(wavelength), -1).T
        return gain * found[None] + shift

    compute = _compiled(with_wavelength(scene, wavelength), names, after=rows)

    def curves(values: Numbers) -> list[Curve]:
        return [Curve(label, wavelength, y) for label, y in zip(labels, compute(values), strict=True)]

    return curves


def colour_program(scene: Scene, names: Sequence[str]) -> Callable[[Numbers], np.ndarray]:
    """Compile XYZ (3,) of the reflected or transmitted light under D65, observer 1931, with Y = 1 for white.

    It is that of the reflected light for ellipsometry. **Raises:** ValueError where a material has no data
    between 380 and 730 nm.
    """
    bands, light = integration_bands(BANDS), scene.light
    if light.ellipsometric:
        scene = with_value(scene, _LIGHT, Light(None, light.angle, azimuth=light.azimuth))
    return _compiled(with_wavelength(scene, bands.wavelength), names, after=lambda r: r @ bands.weights)


def angle_program(
    scene: Scene, controls: Sequence[Control], active: Sequence[str]
) -> Callable[[Numbers], np.ndarray]:
    """Compile XYZ (`COSINES`, 3) of the light that a film reflects, against the cosine of the angle.

    The cosines are 1/`COSINES` to 1. The instrument, spreads of the thickness and the back face are left out.
    **Raises:** as `colour_program`.
    """
    bands = integration_bands(BANDS)
    own, fixed = [], scene
    for control in controls:
        of_film = control.path[0].name in ("layers", "substrate", "ambient")
        if of_film and not any(getattr(step, "name", "") in _OF_THE_INSTRUMENT for step in control.path):
            own.append(control)
        elif control.free is not None:
            fixed = with_value(fixed, control.path, control.value)
    substrate = replace(fixed.substrate, back=None, back_collected=None, back_reflections=None)
    layers = tuple(replace(x, thickness_spread=None) if isinstance(x, Layer) else x for x in fixed.layers)
    light = Light(bands.wavelength, Free(0.0, 90.0), azimuth=fixed.light.azimuth)
    bare = replace(fixed, layers=layers, substrate=substrate, light=light, instrument=Instrument())
    names = [control.name for control in own if not control.optional or control.name in active]
    degrees = np.rad2deg(np.arccos(np.arange(1, COSINES + 1) / COSINES))
    return _compiled(template(bare, own, active), names, over=degrees, after=lambda r: r @ bands.weights)


_LIGHT = (jax.tree_util.GetAttrKey("light"),)


def _compiled(
    scene: Scene,
    names: Sequence[str],
    *,
    after: Callable[[Any], Any],
    over: np.ndarray | None = None,
) -> Callable[[Numbers], np.ndarray]:
    """Compile `after` of a scene's signal as a function of its free numbers, `names` in their order.

    With `over`, one more free number, the last, takes all of these values.
    """
    assert len(names) == len(free_leaves(scene)) - (over is not None)
    with jax.enable_x64(True):
        simulate, evaluated = build(exact(scene).static_key), tabulated(scene)
        start = start_values(scene)[: len(names)]

        @jax.jit
        def program(numbers: Any, evaluated: Any) -> Any:
            if over is None:
                return after(simulate(insert(evaluated, list(numbers))))
            each = jax.vmap(lambda last: simulate(insert(evaluated, [*numbers, last])))
            return after(each(jnp.asarray(over)))

        compiled = program.lower(start, evaluated).compile()

    def compute(values: Numbers) -> np.ndarray:
        with jax.enable_x64(True):
            numbers = np.array([values[name] for name in names], float)
            return np.asarray(compiled(numbers, evaluated))

    return compute
