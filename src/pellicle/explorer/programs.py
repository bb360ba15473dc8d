"""Compiled functions of the numbers of a film: spectrum, colour, and colours against the angle of incidence.

Several angles of incidence give a curve each, or one curve against them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.tree_util import GetAttrKey

from pellicle.colour import integration_bands
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.spectrum import Spectrum
from pellicle.effects.film_plan import exact
from pellicle.errors import UsageError
from pellicle.explorer.controls import STEEPEST, Control, free_paths, template, with_value
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.scene.film import Light, Scene, with_wavelength
from pellicle.scene.free import Free, insert, start_values
from pellicle.scene.instrument import Drift, Instrument
from pellicle.scene.layers import Layer
from pellicle.simulation.colours import BANDS

MOST = 12
"""Most angles of which each has a curve."""
_POINTS, _STEEPEST = 201, 85.0
"""Points of a curve against the angle, and the end of its abscissa where one angle is stated (degrees)."""


def light_angles(light: Light, count: int) -> np.ndarray:
    """Return the angles of a light that has several, (angles,) in degrees and rising; none for one number.

    They are drawn at a `count` of wavelengths.

    Raises UsageError where not every wavelength is seen at each angle, and for more than `MOST` angles at
    several wavelengths.
    """
    if isinstance(light.angle, Free) or not np.ndim(light.angle):
        return np.zeros(0)
    angles = np.unique(np.asarray(light.angle, float))
    if light.wavelength is not None and np.shape(light.wavelength) == np.shape(light.angle):
        pairs = np.unique(np.stack([light.wavelength, light.angle]), axis=1).shape[1]
        if pairs != len(angles) * len(np.unique(light.wavelength)):
            raise UsageError(
                "the explorer draws every wavelength at each angle of incidence: give the scene one angle, or"
                " the same angles at each wavelength"
            )
    if len(angles) > MOST and count > 1:
        raise UsageError(
            f"the explorer draws a curve for each of up to {MOST} angles of incidence, and the scene has"
            f" {len(angles)}: give it fewer, or one wavelength"
        )
    return angles


def measured_angles(spectra: Sequence[Spectrum | BrdfSamples]) -> np.ndarray:
    """Return every angle that spectra state, (angles,) in degrees and rising; none of BRDF samples."""
    stated = [x.angle for x in spectra if isinstance(x, Spectrum) and x.angle is not None]
    return np.unique(np.concatenate(stated)) if stated else np.zeros(0)


def asked_angles(given: Any) -> np.ndarray:
    """Check the angles of a request, which are returned rising and each once. Raises UsageError."""
    asked = given if isinstance(given, list | tuple) else ()
    known = all(isinstance(x, int | float) and not isinstance(x, bool) and 0 <= x <= STEEPEST for x in asked)
    if not known or not 1 <= len(asked) <= MOST:
        raise UsageError(
            f"the angles of incidence must be 1 to {MOST} numbers from 0 to {STEEPEST:g}, such as 65, 70, 75"
        )
    return np.unique(np.asarray(asked, float))


def thinned(angles: np.ndarray) -> np.ndarray:
    """Return at most `MOST` of the angles, the first and the last among them."""
    if len(angles) <= MOST:
        return angles
    return angles[np.unique(np.linspace(0, len(angles) - 1, MOST).round().astype(int))]


def abscissa(angles: np.ndarray) -> np.ndarray:
    """Return the angles of a curve against the angle: from the first to the last of several, else 0 to 85."""
    first, last = (angles[0], angles[-1]) if len(angles) > 1 else (0.0, _STEEPEST)
    return np.linspace(first, max(last, *angles), _POINTS)


def named(angle: float) -> str:
    """Return the name of a curve at this angle, such as `65°`."""
    return f"{angle:g}°"


COSINES = 256
"""Nodes of the cosine of the angle of incidence: colours between them are within 0.001 of white."""
_OF_THE_INSTRUMENT = ("thickness_spread", "plate_mm", "back_collected", "back")
"""Numbers of layers and substrate that a ball does not have."""

Numbers = Mapping[str, float]
"""Values of controls by name."""


class Curve(NamedTuple):
    """One curve of a plot: its signal, and its angle of incidence where several are drawn (`65°`).

    `name` is that of one of several spectra in a file.
    """

    signal: str
    x: np.ndarray
    y: np.ndarray
    setting: str = ""
    name: str = ""

    @property
    def label(self) -> str:
        """Signal, angle and name: `Ψ 65°`, `R (Rp)`."""
        return " ".join(x for x in (self.signal, self.setting, f"({self.name})" if self.name else "") if x)


def spectrum_program(
    scene: Scene, names: Sequence[str], wavelength: np.ndarray, count: int, folded: bool = False
) -> Callable[[Numbers, np.ndarray], list[Curve]]:
    """Compile the spectrum of a scene at wavelengths in nm, as a function of its free numbers `names`.

    The angle of incidence of the scene is free beside them if there are a `count` of angles in degrees,
    (count,), the second argument of the function: each has a curve, or one wavelength has one against them.
    With 0 the angle is the scene's. With `folded` Δ lies in 0 to 180 degrees. A free scale is 1 and a free
    offset 0.

    **Raises:** ValueError where a material has no data.
    """
    scale, offset, kind = scene.instrument.scale, scene.instrument.offset, scene.light.kind
    gain = 1.0 if isinstance(scale, Drift) else float(scale)
    shift = 0.0 if isinstance(offset, Drift) else float(offset)
    kind = replace(kind, folded=True) if folded else kind
    labels = [quantity.symbol for quantity in kind.quantities]

    def rows(signal: Any) -> Any:
        return gain * kind.drawn(signal.reshape(len(wavelength), -1)) + shift

    compute = _compiled(with_wavelength(scene, wavelength), names, after=rows, count=count)

    def curves(values: Numbers, angles: np.ndarray) -> list[Curve]:
        signal = compute(values, angles)
        if not count:
            return [Curve(label, wavelength, y) for label, y in zip(labels, signal, strict=True)]
        if len(wavelength) == 1:
            return [Curve(label, angles, signal[:, i, 0]) for i, label in enumerate(labels)]
        return [
            Curve(label, wavelength, signal[j, i], named(angle))
            for i, label in enumerate(labels)
            for j, angle in enumerate(angles)
        ]

    return curves


def colour_program(
    scene: Scene, names: Sequence[str], count: int
) -> Callable[[Numbers, np.ndarray], np.ndarray]:
    """Compile XYZ (3,) of the reflected or transmitted light under D65, observer 1931, with Y = 1 for white.

    With a `count` of angles, as in `spectrum_program`, it is (count, 3). It is that of the reflected light
    for ellipsometry.

    **Raises:** ValueError where a material has no data between 380 and 730 nm.
    """
    bands, light = integration_bands(BANDS), scene.light
    if light.ellipsometric:
        scene = with_value(scene, LIGHT, Light(None, light.angle, azimuth=light.azimuth))
    scene = with_wavelength(scene, bands.wavelength)
    return _compiled(scene, names, after=lambda r: r @ bands.weights, count=count)


def angle_program(
    scene: Scene, controls: Sequence[Control], active: Sequence[str]
) -> Callable[[Numbers, np.ndarray], np.ndarray]:
    """Compile XYZ (`COSINES`, 3) of the light that a film reflects, against the cosine of the angle.

    The cosines are 1/`COSINES` to 1. The instrument, spreads of the thickness and the back face are left out.
    **Raises:** as `colour_program`.
    """
    bands = integration_bands(BANDS)
    moved, fixed = [], scene
    for control in controls:
        of_film = control.path[0].name in ("layers", "substrate", "ambient")
        if of_film and not any(getattr(step, "name", "") in _OF_THE_INSTRUMENT for step in control.path):
            moved.append(control)
        elif control.free is not None:
            fixed = with_value(fixed, control.path, control.value)
    substrate = replace(fixed.substrate, back=None, back_collected=None, back_reflections=None)
    layers = tuple(replace(x, thickness_spread=None) if isinstance(x, Layer) else x for x in fixed.layers)
    light = Light(bands.wavelength, Free(0.0, 90.0), azimuth=fixed.light.azimuth)
    bare = replace(fixed, layers=layers, substrate=substrate, light=light, instrument=Instrument())
    names = [control.name for control in moved if not control.optional or control.name in active]
    degrees = np.rad2deg(np.arccos(np.arange(1, COSINES + 1) / COSINES))
    compute = _compiled(
        template(bare, moved, active), names, after=lambda r: r @ bands.weights, count=len(degrees)
    )
    return lambda values, _: compute(values, degrees)


LIGHT = (GetAttrKey("light"),)
"""Place of the light in a scene."""
ANGLE = (*LIGHT, GetAttrKey("angle"))
"""Place of the angle of incidence in a scene."""


def _compiled(
    scene: Scene, names: Sequence[str], *, after: Callable[[Any], Any], count: int = 0
) -> Callable[[Numbers, np.ndarray], np.ndarray]:
    """Compile `after` of a scene's signal as a function of its free numbers, `names` in their order.

    With a `count` the angle of incidence, free too, takes as many values in degrees, the second argument.
    """
    paths = free_paths(scene)
    assert len(names) == len(paths) - bool(count)
    with jax.enable_x64(True):
        simulate, evaluated = build(exact(scene).static_key), tabulated(scene)
        start, position = start_values(scene), paths.index(ANGLE) if count else 0
        if count:
            start = np.delete(start, position)

        @jax.jit
        def program(numbers: Any, angles: Any, evaluated: Any) -> Any:
            if not count:
                return after(simulate(insert(evaluated, list(numbers))))

            def seen(angle: Any) -> Any:
                return after(simulate(insert(evaluated, [*numbers[:position], angle, *numbers[position:]])))

            return jax.vmap(seen)(angles)

        compiled = program.lower(start, np.zeros(count), evaluated).compile()

    def compute(values: Numbers, angles: np.ndarray) -> np.ndarray:
        with jax.enable_x64(True):
            numbers = np.array([values[name] for name in names], float)
            return np.asarray(compiled(numbers, angles, evaluated))

    return compute
