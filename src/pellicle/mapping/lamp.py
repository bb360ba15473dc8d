"""Lamp curve of a camera: one gain g(λ) that all pixels of a cube have in common, and its correction.

From a region of known reflectance g is the mean of measured over simulated values. Without one it is fitted
jointly with the films of some pixels (`pellicle.mapping.joint_lamp`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.photographs import parse_regions
from pellicle.errors import DataError, UsageError
from pellicle.mapping.joint_lamp import PIXELS, joint_gain
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import free_leaves
from pellicle.scene.instrument import Instrument
from pellicle.scene.layers import Layer
from pellicle.signals.registry import kind
from pellicle.simulation.spectra import simulate_signal

_DARK = 1e-3
"""Least simulated reflectance of a reference, as a share of its largest."""


@dataclass(frozen=True, eq=False, repr=False)
class LampCurve:
    """Gain of lamp and camera at each wavelength (nm), (bands,), with its standard error by the noise.

    Measured values are `gain` times those of the scene. `separation` is the least share of the information on
    any shape of the gain that the free parameters of the pixels leave, 1 for a region of known reflectance.
    `level` is False where the mean of log g is not determined and set to 0: the scale of the scene is free.
    """

    wavelength: np.ndarray
    gain: np.ndarray
    stderr: np.ndarray
    pixels: int
    separation: float = 1.0
    level: bool = True
    source: str = "joint"

    def __str__(self) -> str:
        low, high = self.gain.min(), self.gain.max()
        error = 100 * float(np.median(self.stderr / self.gain))
        how = "fitted together with the films of" if self.source == "joint" else f"of region {self.source},"
        level = "" if self.level else ", up to a constant factor"
        return (
            f"lamp curve {how} {self.pixels} pixels: gain {low:.4g} to {high:.4g}{level}, standard error"
            f" {error:.2g} %"
        )

    __repr__ = __str__

    def correct(self, cube: Cube) -> Cube:
        """The cube divided by the gain, block by block as it is read."""
        return cube.divided(self.gain, str(self))


def lamp_curve(
    cube: Cube,
    scene: Scene,
    region: str | Sequence[int] | None = None,
    *,
    reference: Scene | None = None,
    pixels: int = PIXELS,
) -> LampCurve:
    """Estimate the lamp curve that all pixels of a cube have in common.

    **Arguments:**

    - `cube` of R or T; `scene` of its pixels, as for a map.
    - `region`: "x,y,width,height" of a part of the image whose scene is known, in pixels from the upper left
      corner: that of `reference`, by default the substrate of `scene` without layers. None for a joint fit of
      the lamp and of the films of some `pixels`.

    **Returns:** `LampCurve`; `correct` divides a cube by it.

    A gradient of the light over the image is no lamp curve: a free scale of each pixel allows for it. What
    the scene has wrong for all pixels alike, such as an index, becomes part of a joint curve.

    **Raises:** UsageError for ellipsometry, which has no lamp curve, for a region outside the image or of a
    scene with free parameters, and where the pixels differ too little to tell their films from the lamp;
    DataError where too few pixels have data.

    **Source:** of `pellicle.mapping.joint_lamp`.
    """
    if kind(cube.signal).ellipsometric:
        raise UsageError("ellipsometry compares polarisations of the same light and has no lamp curve")
    if region is None:
        return LampCurve(cube.wavelength, *joint_gain(cube, scene, pixels))
    bare = Scene(Layer(1.0, 0.0), scene.substrate, scene.ambient, scene.light, scene.instrument)
    return _of_region(cube, bare if reference is None else reference, region)


def lamp_curve_of(
    wanted: str | Sequence[int] | LampCurve, cube: Cube, scene: Scene, reference: Scene | None = None
) -> LampCurve:
    """The lamp curve of an argument of a map: a curve, "joint", or a region. Raises as `lamp_curve`."""
    if isinstance(wanted, LampCurve):
        if len(wanted.gain) != cube.wavelength.size:
            raise UsageError(
                f"`lamp_curve` has {len(wanted.gain)} bands, and the cube has {cube.wavelength.size}"
            )
        return wanted
    if wanted == "joint" and reference is not None:
        raise UsageError("`lamp_reference` is of a region: give it as `lamp_curve`, x,y,width,height")
    return lamp_curve(cube, scene, None if wanted == "joint" else wanted, reference=reference)


def _of_region(cube: Cube, reference: Scene, region: str | Sequence[int]) -> LampCurve:
    """Mean of measured over simulated values of a region, and its standard error."""
    [box, *others] = parse_regions(region, "lamp_curve")
    if others or cube.dims[-2:] != ("y", "x"):
        raise UsageError("`lamp_curve` must be joint or one rectangle x,y,width,height of an image")
    height, width = cube.shape[-2:]
    if min(box.x, box.y) < 0 or box.x + box.width > width or box.y + box.height > height:
        raise UsageError(f"`lamp_curve` {box} leaves the image of {width} by {height} pixels; shrink it")
    known = eqx.tree_at(lambda s: s.instrument, reference, Instrument())
    if free_leaves(known):
        raise UsageError("`lamp_reference` must be known: fix the free parameters of its scene")
    wavelength, angle = cube.wavelength, known.light.angle
    if cube.angle is not None:
        wavelength, angle = np.repeat(wavelength, cube.angle.size), np.tile(cube.angle, wavelength.size)
    light = Light(None, angle, cube.signal, cube.polarisation, known.light.azimuth)
    known = eqx.tree_at(lambda s: s.light, known, light, is_leaf=lambda x: x is None)
    simulated = simulate_signal(known, wavelength).clean
    rows = (slice(None),) * (len(cube.dims) - 2)
    values = cube.pixels((*rows, slice(box.y, box.y + box.height), slice(box.x, box.x + box.width)))["values"]
    bands = cube.wavelength.size
    usable = np.abs(simulated) > _DARK * np.abs(simulated).max()
    ratio = np.where(usable, values / np.where(usable, simulated, 1.0), np.nan)
    ratio = np.moveaxis(ratio.reshape(len(ratio), bands, -1), 1, 0).reshape(bands, -1)
    count = np.isfinite(ratio).sum(axis=1)
    if count.min() < 4:
        nm = cube.wavelength[np.argmin(count)]
        raise DataError(
            f"{cube.path or 'cube'}: region {box} has fewer than four measured values at {nm:g} nm"
        )
    gain = np.nanmean(ratio, axis=1)
    stderr = np.nanstd(ratio, axis=1, ddof=1) / np.sqrt(count)
    if gain.min() <= 0:
        nm = cube.wavelength[np.argmin(gain)]
        raise DataError(f"{cube.path or 'cube'}: region {box} is dark at {nm:g} nm; choose a brighter one")
    return LampCurve(cube.wavelength, gain, stderr, len(values), source=str(box))
