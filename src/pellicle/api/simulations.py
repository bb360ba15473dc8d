"""Verbs of simulation: spectra, colours and BRDF samples of a scene, and light against depth."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.result import Fit
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface, check_scene, refuse
from pellicle.simulation.brdf import Directions, simulate_samples
from pellicle.simulation.colours import simulate_colours
from pellicle.simulation.depth_profile import DepthProfile
from pellicle.simulation.depth_profile import depth_profile as film_depth_profile
from pellicle.simulation.spectra import default_wavelengths, simulate_spectrum

if TYPE_CHECKING:
    from pellicle.mapping.map_result import Map
    from pellicle.mapping.photograph import ThicknessMap
    from pellicle.rendering.export import Export


@overload
def simulate(
    scene: Scene,
    wavelength: ArrayLike | None = None,
    *,
    noise: float = 0.0,
    seed: int = 0,
    depolarisation_noise: float | None = None,
    elements: Sequence[str] | None = None,
    sensor: None = None,
    space: None = None,
) -> Spectrum: ...
@overload
def simulate(
    scene: Scene,
    *,
    sensor: tuple[np.ndarray, np.ndarray] | Colours | None = None,
    space: str | None = None,
    angle: ArrayLike | None = None,
    gamma: float = 1.0,
    noise: float = 0.0,
    seed: int = 0,
) -> Colours: ...
@overload
def simulate(
    scene: Surface,
    *,
    directions: Directions | BrdfSamples | None = None,
    noise: float | str | Sequence[float | str] = 0.0,
    seed: int = 0,
) -> BrdfSamples: ...
def simulate(scene: Scene | Surface, wavelength: ArrayLike | None = None, **options: Any) -> Any:
    """Simulate a measurement of `scene`: spectrum or colours of a film, or samples of a surface's BRDF.

    **Arguments:**

    - `scene`: `Scene` or `Surface`. Free parameters take their start values; a free scale is 1 and a free
      offset 0.
    - `wavelength`: nm, shape (wavelengths,). Of a `Scene` only; 380 to 780 every 2 nm by default, within the
      tables of its materials.
    - `directions`: pairs of directions to light and eye, or the samples of which to take them. Of a
      `Surface` only; 1000 pairs by default, spread over the lobe and around it.
    - `noise`: standard deviation of the normal noise, in the unit of the signal: a fraction for R and T,
      degrees for Ψ and Δ, that of each normalised Mueller element, 1/sr for a BRDF. It becomes the σ of the
      result. Of a BRDF also a share of the signal, as "2 %", or a list of one for each channel.
    - `seed` of the noise.
    - `depolarisation_noise`: standard deviation of the depolarisation, a fraction; 0 for one without noise. A
      spectrum of Ψ and Δ has a depolarisation where something in the scene depolarises (a thickness spread, a
      bandwidth, a cone of light, a back face), and wherever this noise is given. By default the noise is
      4·`noise` in radians, that of 1 − N² − C² − S².
    - `elements`: names of the elements of a Mueller matrix, such as ["m12", "m33", "m34"]; all 15 beside m11
      by default.
    - `sensor`, `space`: for colours, of a `Scene` only. `sensor` is wavelengths (N,), nm, and weights (N, 3)
      as of `pellicle.colour.sensor`, the CIE observer 1931 under D65 by default, or `Colours` of which
      sensor, space, gamma and angles are taken. `space` is "srgb" (the default), "rgb", "xyz" or "lab".
    - `angle` of incidence of the colours in degrees, (colours,); that of the scene by default.
    - `gamma` of "rgb".

    **Returns:** `Spectrum`, `BrdfSamples` or `Colours`, as `pellicle.fit` takes them.

    **Raises:** ValueError where a material has no data at a wavelength; UsageError for a surface that
    reflects nothing, or has neither one channel nor R, G and B.

    ```python
    >>> scene = pl.Scene(pl.Layer("SiO2", 500.0), "Si")
    >>> pl.simulate(scene, [500.0, 600.0, 700.0]).values.round(4).tolist()
    [0.3769, 0.1065, 0.3259]
    >>> pl.simulate(scene, space="srgb", angle=[0, 60]).values.round(2).tolist()
    [[0.28, 0.52, 0.6], [0.65, 0.6, 0.52]]

    ```
    """
    check_scene(scene)
    return _simulated(scene, wavelength, **options)


def _simulated(
    scene: Scene | Surface,
    wavelength: ArrayLike | None,
    *,
    directions: Directions | BrdfSamples | None = None,
    noise: float | str | Sequence[float | str] = 0.0,
    seed: int = 0,
    depolarisation_noise: float | None = None,
    elements: Sequence[str] | None = None,
    sensor: tuple[np.ndarray, np.ndarray] | Colours | None = None,
    space: str | None = None,
    angle: ArrayLike | None = None,
    gamma: float = 1.0,
) -> Spectrum | BrdfSamples | Colours:
    """Simulate what the arguments ask for; they are those of `simulate`."""
    if isinstance(noise, float | int) and not noise >= 0:
        raise UsageError(f"`noise` must not be negative, got {noise:g}")
    of_spectra: dict[str, Any] = {"depolarisation_noise": depolarisation_noise, "elements": elements}
    if isinstance(scene, Surface):
        refuse("a Surface", wavelength=wavelength, sensor=sensor, space=space, angle=angle, **of_spectra)
        return simulate_samples(scene, directions, noise, seed).samples
    refuse("a Scene", directions=directions)
    if not isinstance(noise, float | int):
        raise UsageError(f"`noise` of a Scene must be one number, a standard deviation, not {noise!r}")
    if sensor is not None or space is not None:
        refuse("colours", wavelength=wavelength, **of_spectra)
        how: dict[str, Any] = {"gamma": gamma, "noise": noise, "seed": seed}
        if isinstance(sensor, Colours):
            space, how["gamma"], how["camera"] = sensor.space, sensor.gamma, sensor.camera
            sensor, angle = sensor.sensor, sensor.angle if angle is None else angle
        return simulate_colours(scene, sensor, space or "srgb", angle, **how)[0]
    refuse("a spectrum, whose angle is that of the scene's light", angle=angle)
    return simulate_spectrum(scene, wavelength, noise=noise, seed=seed, **of_spectra)


def depth_profile(scene: Scene, at: ArrayLike, wavelength: ArrayLike | None = None) -> DepthProfile:
    """Compute where a film absorbs light: absorptance of each layer and plate, and the field against depth.

    Plane monochromatic waves: the instrument's bandwidth, cone and spreads are left out.

    **Arguments:**

    - `scene`: `Scene`, whose free parameters take their start values.
    - `at`: wavelengths in nm of the field, a number or (chosen,).
    - `wavelength`: nm, (wavelengths,), of the absorptances; by default as in `pellicle.simulate`.

    **Returns:** `DepthProfile`: R, T and the `absorptance` of each layer and plate, which add up to 1, and
    |E|² and absorbed power per nm in the `sections` between thick media. T enters the substrate, which
    absorbs it unless it is transparent.

    **Raises:** UsageError for rough faces and for a light of several angles; ValueError where a material has
    no data at a wavelength.

    ```python
    >>> scene = pl.Scene(pl.Layer("Au", 40.0), pl.Substrate("BK7", back="air"))
    >>> profile = pl.depth_profile(scene, 550.0, [500.0, 550.0])
    >>> profile.media
    ('Au', 'substrate')
    >>> (profile.R + profile.T + profile.absorptance.sum(axis=0)).round(12).tolist()
    [1.0, 1.0]

    ```
    """
    check_scene(scene)
    if isinstance(scene, Surface):
        raise UsageError("a depth profile is one of a film: give a pl.Scene, not a Surface")
    return film_depth_profile(scene, at, default_wavelengths(scene) if wavelength is None else wavelength)


def explore(scene: Scene | Surface, *, wavelength: ArrayLike | None = None) -> Any:
    """Show a film in a notebook: sliders beside its spectrum, colour, sphere and plan, which follow them.

    Of a surface, sliders beside the lobes of its BRDF in the plane of incidence, a sphere and the plan.

    The page is that of `pellicle explore`; it needs no network.

    **Arguments:**

    - `scene`: the film or the surface; every number in it that a slider can move has one, free or not. Of
      several angles of incidence, `pl.Light(angle=[65, 70, 75])`, each has a curve.
    - `wavelength`: wavelengths of the plot in nm, (wavelengths,), by default those of the scene's light or
      the visible ones.

    **Returns:** A widget (anywidget): `values` are the sliders' numbers by name, in their units, and setting
    them moves the sliders; `angles` are angles of incidence in degrees in place of the scene's, empty for
    those; `recipe()` is the film in its current state as TOML.

    **Raises:** UsageError without the package anywidget, and for a scene of several azimuths, of generalised
    psi and delta or of more than 12 angles at several wavelengths; DataError where the materials
    share no wavelengths.
    """
    from pellicle.explorer.session import Session
    from pellicle.explorer.widget import widget

    check_scene(scene)
    return widget(Session(scene, wavelength=wavelength))


def export(
    scene: Scene | Surface | Fit,
    *,
    to: str,
    path: str | os.PathLike[str],
    numbers: str = "effective",
    thickness_map: ArrayLike | Map | ThicknessMap | str | os.PathLike[str] | None = None,
    roughness_map: ArrayLike | str | os.PathLike[str] | None = None,
    layer: str | None = None,
) -> Export:
    """Write a film as a material of a renderer, and how far its formula is from the exact colours.

    A renderer computes a film's colour by an approximate formula. `pellicle` solves for the thickness, index
    and base with which this formula comes closest to the exact colours (CIE 1931, D65) from 0 to 80 degrees,
    and writes them and the film's own numbers with the mean and the largest ΔE2000 of both.

    **Arguments:**

    - `scene`: `Scene` or `Surface`, whose free parameters take their start values, or `Fit` with its best
      values.
    - `to`: "blender", "gltf", "materialx", "mitsuba", "openpbr" or "usd".
    - `path`: file to write, which must not exist; a record in JSON is written beside it.
    - `numbers`: the set that the renderer draws, "effective" or "physical".
    - `thickness_map`: thicknesses in nm over the object, (rows, columns) from the upper left; the path of
      a `.npy` file or a grey image of them; or what `pellicle.map` returns. Pixels without a thickness take
      the nearest. Free parameters of the base become textures of it, but in "mitsuba"; the others of `scene`
      take the medians of a cube's map. Not for "usd".
    - `roughness_map`: roughness of the facets over the object, GGX α from 0 to 1, as an array or the path of
      a `.npy` file or a grey image (white is 1); not for "usd".
    - `layer`: name of the layer whose thickness it is (the free one, or else the first).

    **Returns:** `Export`: the files, and `material` with both sets of numbers and their errors.

    **Raises:** UsageError for an unknown renderer, for a package that is absent, and for a file that exists;
    ValueError where a material has no data between 380 and 730 nm.
    """
    from pellicle.rendering.export import export as export_film

    maps = {"thickness_map": thickness_map, "roughness_map": roughness_map}
    return export_film(scene, to, path, numbers=numbers, layer=layer, **maps)
