"""Simulated measurements of a film's colours, in any colour space, with noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pellicle.colour.cameras import srgb_sensor
from pellicle.colour.encoding import camera_encoding, encoding
from pellicle.colour.observers import sensor as observer
from pellicle.data.colours import SPACES, CameraMatrix, Colours
from pellicle.effects.plan import Plan
from pellicle.errors import UsageError
from pellicle.scene.film import Scene, with_wavelength
from pellicle.synthetic.spectra import simulate_signal


def simulate_colours(
    scene: Scene,
    sensor: tuple[np.ndarray, np.ndarray] | None = None,
    space: str = "srgb",
    angle: ArrayLike | None = None,
    *,
    gamma: float = 1.0,
    camera: CameraMatrix | None = None,
    noise: float = 0.0,
    seed: int = 0,
    tolerance: float = 0.0,
) -> tuple[Colours, Plan]:
    """Simulate the colours of a film, and return them with the plan of the simulation.

    The spectrum is integrated over the sensor's wavelengths. The scale of the scene's instrument is the
    exposure.

    **Arguments:**

    - `sensor`: wavelengths (N,) in nm and weights (N, 3), as of `pellicle.colour.sensor`; None for the CIE
      observer 1931 under D65 and, in "rgb", linear sRGB.
    - `space`: "srgb", "rgb", "xyz" or "lab"; `gamma` of "rgb", and `camera` with its matrix.
    - `angle` of incidence in degrees, (colours,); None for that of the scene.
    - `noise`: standard deviation of the values, which becomes their σ; `seed` of it.
    - `tolerance`: largest error of the spectrum (see `pellicle.plan`).

    **Raises:** UsageError for ellipsometry and an unknown space; ValueError where a material has no data at a
    wavelength of the sensor.
    """
    if scene.light.signal == "psi-delta":
        raise UsageError("ellipsometry has no colour: use a scene with signal R or T")
    if space not in SPACES:
        raise UsageError(f"`space` must be one of {', '.join(SPACES)}, not {space!r}")
    if sensor is None:
        eye = observer()
        sensor = srgb_sensor(eye) if space == "rgb" else eye
    nm, weights = (np.asarray(x, float) for x in sensor)
    own: Any = getattr(scene.light.angle, "start", scene.light.angle)
    angles = np.atleast_1d(np.asarray(own if angle is None else angle, float))
    grid = np.tile(nm, angles.size)
    simulated = simulate_signal(
        with_wavelength(scene, grid, np.repeat(angles, nm.size)), grid, tolerance=tolerance
    )
    white = weights.sum(axis=0)
    coding = encoding(space, white) if space != "rgb" else camera_encoding(gamma)
    if space == "rgb":
        coding = coding._replace(linear=np.diag(1 / white) if camera is None else np.asarray(camera.matrix))
    channels = coding.channels(simulated.clean.reshape(angles.size, nm.size) @ weights)
    values = coding.encode(channels, coding.roots(channels))
    values = values + noise * np.random.default_rng(seed).normal(0.0, 1.0, values.shape)
    if coding.clips:
        values = np.clip(values, 0.0, 1.0)
    colours = Colours(
        values,
        (nm, weights),
        space,
        scene.light.signal,
        sigma=np.full(values.shape, noise) if noise > 0 else None,
        angle=angles,
        polarisation=scene.light.polarisation,
        gamma=gamma,
        camera=camera,
    )
    return colours, simulated.plan
