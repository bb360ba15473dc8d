"""The public verbs. Each takes a `Scene` (a film) or a `Surface` (a BRDF), and does the same with both."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.cubes.detect import is_picture
from pellicle.data.measurement import Measurement, check_measurement
from pellicle.data.read_cube import read_cube
from pellicle.data.spectrum import Spectrum
from pellicle.effects.plan import Plan
from pellicle.errors import UsageError
from pellicle.fitting.brdf.fit import fit as fit_brdf
from pellicle.fitting.comparison import Comparison
from pellicle.fitting.comparison import compare as compare_fits
from pellicle.fitting.joint import fit as fit_jointly
from pellicle.fitting.joint import of_both_kinds
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.result import Fit
from pellicle.fitting.spectra.fit import fit as fit_spectra
from pellicle.mapping.picture import ThicknessMap, map_picture
from pellicle.planning.film import plan as film_plan
from pellicle.planning.surface import plan as surface_plan
from pellicle.sampling.ensemble import STEPS
from pellicle.sampling.result import Posterior
from pellicle.sampling.sample import OF_A_FILM, measured
from pellicle.sampling.sample import sample as sample_posterior
from pellicle.scene.film import Scene
from pellicle.scene.kinds import check_scene
from pellicle.scene.surface import Surface, SurfaceView, surface_view
from pellicle.synthetic.brdf import Directions, default_directions, simulate_samples
from pellicle.synthetic.depth_profile import DepthProfile
from pellicle.synthetic.depth_profile import depth_profile as film_depth_profile
from pellicle.synthetic.measured_colours import simulate_colours
from pellicle.synthetic.spectra import default_wavelengths, simulate_spectrum

if TYPE_CHECKING:
    from pellicle.accuracy.cost import Cost
    from pellicle.accuracy.surface import SurfaceCost
    from pellicle.mapping.lamp import LampCurve
    from pellicle.mapping.map_result import Map
    from pellicle.rendering.export import Export


_OF_A_CUBE = (
    "out",
    "workers",
    "scheduler",
    "resume",
    "overwrite",
    "preview",
    "lamp_curve",
    "lamp_reference",
    "neighbours",
    "recipe",
    "progress",
)
"""Arguments of `map` for a cube, besides those of reading it."""


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
def simulate(
    scene: Scene | Surface,
    wavelength: ArrayLike | None = None,
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
    if isinstance(noise, float | int) and not noise >= 0:
        raise UsageError(f"`noise` must not be negative, got {noise:g}")
    if isinstance(scene, Surface):
        _refuse("a Surface", wavelength=wavelength, depolarisation_noise=depolarisation_noise)
        _refuse("a Surface", sensor=sensor, space=space, angle=angle, elements=elements)
        return simulate_samples(scene, directions, noise, seed).samples
    _refuse("a Scene", directions=directions)
    if not isinstance(noise, float | int):
        raise UsageError(f"`noise` of a Scene must be one number, a standard deviation, not {noise!r}")
    if sensor is not None or space is not None:
        _refuse("colours", wavelength=wavelength, depolarisation_noise=depolarisation_noise)
        _refuse("colours", elements=elements)
        camera = None
        if isinstance(sensor, Colours):
            space, gamma, camera = sensor.space, sensor.gamma, sensor.camera
            sensor, angle = sensor.sensor, sensor.angle if angle is None else angle
        return simulate_colours(
            scene, sensor, space or "srgb", angle, gamma=gamma, camera=camera, noise=noise, seed=seed
        )[0]
    _refuse("a spectrum, whose angle is that of the scene's light", angle=angle)
    return simulate_spectrum(
        scene,
        wavelength,
        noise=noise,
        seed=seed,
        depolarisation_noise=depolarisation_noise,
        elements=elements,
    )


def plan(
    scene: Scene | Surface,
    tolerance: float = 0.0,
    *,
    keep: Iterable[str] = (),
    directions: Directions | BrdfSamples | None = None,
) -> Plan:
    """List the effects that a simulation of `scene` needs, to be exact or within `tolerance`.

    **Arguments:**

    - `scene`: `Scene`, with wavelengths in its light if `tolerance` is not 0, or `Surface`.
    - `tolerance`: largest error of the signal anywhere within the bounds. R and T: a fraction. Ψ and Δ:
      degrees on the sphere of N, C and S (Ψ is off by half of that at most, Δ by that over sin 2Ψ). BRDF:
      relative to its value, or to 0.01/π where it is darker than that. At 0 an effect is left out only
      where it is absent.
    - `keep`: effects that must stay, by the keys of a plan (`"back-face"`, `"polarisation"`, ...).
    - `directions`: pairs of directions to light and eye. Of a `Surface` only; see `pellicle.simulate`.

    **Returns:** `Plan`, whose `rows` name each effect, whether it is on, why, and a bound on the error of
    leaving it out.

    **Raises:** ValueError for a negative tolerance, and for a tolerance without wavelengths.

    ```python
    >>> plan = pl.plan(pl.Scene(pl.Layer("SiO2", 500.0), "Si", light=pl.Light(angle=60.0)))
    >>> plan.on("polarisation"), plan.on("back-face")
    (True, False)

    ```
    """
    check_scene(scene)
    if isinstance(scene, Surface):
        return surface_plan(_view(scene, directions), tolerance, keep)
    _refuse("a Scene", directions=directions)
    return film_plan(scene, tolerance, keep)


@overload
def cost(
    scene: Scene,
    wavelength: ArrayLike | None = None,
    *,
    reference: str = "float64",
    tolerance: float | None = None,
    noise: float | None = None,
    datasets: int = 20,
    space: str | None = None,
    angle: ArrayLike | None = None,
    progress: Progress = quiet,
) -> Cost: ...
@overload
def cost(
    scene: Surface,
    *,
    directions: Directions | BrdfSamples | None = None,
    tolerance: float | None = None,
    progress: Progress = quiet,
) -> SurfaceCost: ...
def cost(
    scene: Scene | Surface,
    wavelength: ArrayLike | None = None,
    *,
    directions: Directions | BrdfSamples | None = None,
    reference: str = "float64",
    tolerance: float | None = None,
    noise: float | None = None,
    datasets: int = 20,
    space: str | None = None,
    angle: ArrayLike | None = None,
    progress: Progress = quiet,
) -> Cost | SurfaceCost:
    """Measure error and time of every method of simulating `scene`, and of fitting it.

    **Arguments:**

    - `scene`: `Scene` or `Surface`.
    - `wavelength`: nm, shape (wavelengths,). Of a `Scene` only; by default those of its light, or as in
      `pellicle.simulate`.
    - `directions`: pairs of directions to light and eye. Of a `Surface` only; see `pellicle.simulate`.
    - `reference`: what errors are measured against: "float64", or "mpmath" with 50 digits (`Scene` only).
    - `tolerance`: the error that is small enough. R and T: a fraction, 0.001 by default. Ψ and Δ: degrees on
      the sphere of N, C and S, 0.1 by default. BRDF: mean ΔE2000 of its film's colour, 0.5 by default, or
      relative to its value where it has no such film.
    - `noise`: standard deviation of the spectra that are fitted, as in `pellicle.simulate`; by default the
      tolerance. A noise without a tolerance is the tolerance too. (`Scene` only)
    - `datasets`: number of simulated spectra that every solver fits; 0 leaves the solvers out.
      (`Scene` only)
    - `space`: a colour space such as "srgb", for the methods of integrating the colours of a film at `angle`
      of incidence in degrees, (angles,): mean ΔE2000 of the observer 1931 under D65, 0.5 by default.
      (`Scene` only)
    - `progress`: called with the name of a stage, the number of steps done and their total.

    **Returns:** `Cost` or `SurfaceCost`: for each method its error, its time, and whether another one is
    both faster and more accurate.

    **Raises:** UsageError for a tolerance that is not above zero, for a reference that cannot compute the
    scene, for a scene whose signal is 0 everywhere, and for the colours of a surface without
    colour-science.
    """
    from pellicle.accuracy.cost import cost as film_cost  # solvers, a fifth of the time of importing this
    from pellicle.accuracy.film_colours import colour_cost
    from pellicle.accuracy.surface import cost as surface_cost

    check_scene(scene)
    if isinstance(scene, Surface):
        _refuse("a Surface", wavelength=wavelength, noise=noise, space=space, angle=angle)
        view = _view(scene, directions)
        return surface_cost(view, tolerance=tolerance, progress=progress)
    _refuse("a Scene", directions=directions)
    if space is not None:
        _refuse("colours", wavelength=wavelength, noise=noise)
        return colour_cost(scene, angle, tolerance=tolerance, progress=progress)
    _refuse("spectra, whose angle is that of the scene's light", angle=angle)
    if wavelength is None:
        own = scene.light.wavelength
        wavelength = default_wavelengths(scene) if own is None else own
    return film_cost(
        scene,
        np.asarray(wavelength, dtype=float),
        reference=reference,
        tolerance=tolerance,
        noise=noise,
        datasets=datasets,
        progress=progress,
    )


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


def fit(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    *,
    tolerance: float = 0.0,
    loss: str = "least-squares",
    residual: str | None = None,
    progress: Progress = quiet,
) -> Fit:
    """Fit the free parameters of `scene` to `data`, in float64.

    **Arguments:**

    - `data`: `Spectrum` or `Colours`, or a list of these, of one sample (a joint fit); or `BrdfSamples`, or a
      list; or a list of both kinds.
    - `scene`: `Scene`, or a list with one for each spectrum; `Surface` for `BrdfSamples`. Signal, angle and
      polarisation come from the data. For a list of both kinds it is a list too, of scenes and the surface:
      free numbers of one name, such as `thickness`, are then one.
    - `tolerance`: leave out effects that change the signal by less (see `pellicle.plan`); where the best fit
      turns out to be off by more, the fit is done again with every effect.
    - `loss`: "least-squares", or "huber" or "student-t" against outliers.
    - `residual`: what is compared of a BRDF (`Surface` only): "linear", "cosine", "log" or "cube-root". By
      default "linear" where the samples have a σ, else "cube-root".
    - `progress`: called with the name of a stage, the number of steps done and their total.

    **Returns:** `Fit`: parameters with errors, a status with a verdict, every rival minimum.
    `print(fit)` is short; `fit.report()`, `fit.plot()` and `fit.save(folder)` are the full report, the
    figure, and files of both.

    **Raises:** UsageError where nothing is free, where the scenes of a joint fit are not of one sample,
    where an uncalibrated signal has a fixed scale, for an unknown loss or residual, and for too few samples;
    ValueError where a material has no data at a wavelength.

    ```python
    >>> scene = pl.Scene(pl.Layer("SiO2", pl.Free(100, 1000)), "Si")
    >>> spectrum = pl.simulate(pl.Scene(pl.Layer("SiO2", 500.0), "Si"), noise=0.002)
    >>> fit = pl.fit(spectrum, scene)
    >>> round(fit["thickness"].value), fit.status.value
    (500, 'converged')

    ```
    """
    check_measurement(data)
    check_scene(scene, several=True)
    if of_both_kinds(scene):
        both: Any = data, scene
        return fit_jointly(*both, residual=residual, tolerance=tolerance, loss=loss, progress=progress)
    if isinstance(scene, Surface):
        samples = measured((BrdfSamples,), data)
        return fit_brdf(samples, scene, residual=residual, tolerance=tolerance, loss=loss, progress=progress)
    _refuse("a Scene", residual=residual)
    films: Any = measured(OF_A_FILM, data), scene
    return fit_spectra(*films, tolerance=tolerance, loss=loss, progress=progress)


def sample(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    *,
    walkers: int | None = None,
    steps: int = STEPS,
    seed: int = 0,
    chain: str | os.PathLike[str] | None = None,
    tolerance: float = 0.0,
    residual: str | None = None,
    progress: Progress = quiet,
) -> Posterior:
    """Fit as `pellicle.fit` does, then sample the posterior of the free parameters, in float64.

    Priors are those of the `Free` parameters, uniform between the bounds by default. Walkers start in every
    minimum of the fit in proportion to its share.

    **Arguments:**

    - `data`, `scene`, `tolerance`, `residual`, `progress`: as in `pellicle.fit`.
    - `walkers`: number of walkers, two for each free parameter at least.
    - `steps`: most steps; the chain ends before that where it is 50 autocorrelation times long and passes
      its checks. 20000 by default.
    - `seed` of the chain.
    - `chain`: file in which the chain is kept as it grows; an interrupted run continues from it.

    **Returns:** `Posterior`: draws, marginals, modes with their mass, and the checks of the chain.

    **Raises:** as `pellicle.fit` does; UsageError for too few walkers, or more than fit into memory;
    DataError for the chain of another problem.
    """
    check_measurement(data)
    check_scene(scene, several=True)
    if not isinstance(scene, Surface):
        _refuse("a Scene", residual=residual)
    return sample_posterior(
        data,
        scene,
        walkers=walkers,
        steps=steps,
        seed=seed,
        chain=chain,
        tolerance=tolerance,
        residual=residual,
        progress=progress,
    )


@overload
def map(  # pyright: ignore[reportOverlappingOverload]  # a path is of either kind
    data: str | os.PathLike[str],
    scene: Scene,
    *,
    strip: str | Sequence[int] | None = None,
    region: str | Sequence[int] | None = None,
    space: str | None = None,
    observer: str = "1931",
    illuminant: str = "D65",
    lamp: str | os.PathLike[str] | None = None,
    sensitivities: str | os.PathLike[str] | None = None,
    gamma: float = 1.0,
    white: str | Sequence[int] | None = None,
    layer: str | None = None,
    noise: float | None = None,
) -> ThicknessMap: ...
@overload
def map(
    data: Any,
    scene: Scene,
    *,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = 1,
    scheduler: str | None = None,
    resume: bool = True,
    overwrite: bool = False,
    preview: bool = False,
    neighbours: bool = False,
    lamp_curve: str | Sequence[int] | LampCurve | None = None,
    lamp_reference: Scene | None = None,
    recipe: str = "",
    progress: Progress = quiet,
    **reading: Any,
) -> Map: ...
def map(data: Any, scene: Scene, **options: Any) -> Any:
    """Fit the free parameters of `scene` at every pixel of a cube of spectra, or the thickness of a picture.

    Every pixel of a cube is fitted as `pellicle.fit` fits a spectrum, with the same statuses. Each position
    of a picture is inverted by itself (`pellicle.colour.ColourInverse`), between the bounds of the free
    thickness; other free parameters take their start values, and a free scale of the instrument is a free
    exposure of each position.

    **Arguments:**

    - `data`: a cube: an xarray DataArray or Dataset, a `Cube`, or the path of one (zarr, NetCDF, ENVI, TIFF
      stack, `.npy`, folder of spectra); or the path of a picture in colours (PNG, TIFF or JPEG).
    - `scene`: a film; of a picture with a free thickness.

    Of a cube:

    - `out`: path of the zarr store of the map, a temporary one by default. A store of the same input and
      scene that an earlier run left unfinished is continued; not with `resume=False`. `overwrite` replaces
      any other map there.
    - `workers`: processes on this machine, of one thread each. A script that asks for several needs
      `if __name__ == "__main__":`. None: as many as there are cores, if that saves time.
    - `scheduler`: address of a dask scheduler, "tcp://host:8786", whose workers reach the files by the same
      paths.
    - `preview`: fit only so many pixels, evenly spread, that it takes seconds; `out` must be another one.
    - `neighbours`: decide ambiguous pixels by the order of interference of their neighbours. The result is
      stored beside `out`, with "-neighbours" in its name.
    - `lamp_curve`: a gain against wavelength that all pixels have in common, by which the cube is divided:
      "joint", fitted together with the films of some pixels; "x,y,width,height", from a region whose scene is
      `lamp_reference`, by default the bare substrate; or a `LampCurve`.
    - `recipe`: text of the scene's recipe, kept in the map.
    - `progress`: called with the name of a stage, the number of pixels done and their total.
    - `reading`: arguments of `pellicle.read_cube`, such as `wavelengths`, `signal_unit`, `noise`, `mask`.

    Of a picture:

    - `strip`: "x0,y0,x1,y1", the ends of a line, 5 pixels wide; or `region`: "x,y,width,height", by default
      the whole picture. Pixels count from the upper left corner.
    - `space`: "srgb" (the default), or "rgb" with its `gamma`.
    - `observer`, `illuminant`, `lamp`, `sensitivities`, `white`: as in `pellicle.read_colours_by_film`.
    - `layer`: name of the layer whose thickness is sought, the free one by default.
    - `noise`: standard deviation of a coded channel, by default 1.5/255 of sRGB and 0.01 of "rgb".

    **Returns:** of a cube a `Map`: `dataset` has values, standard errors, status and rivals of each pixel. Of
    a picture a `ThicknessMap`: `found` has thickness, standard error (of the noise alone), probability and
    status of each position, the most probable thickness first.

    **Raises:** DataError for data that cannot be read; UsageError for arguments of the other kind of data,
    for a store that is of another map, for pixels outside a picture, and where nothing is free.
    """
    check_scene(scene)
    if isinstance(scene, Surface):
        raise UsageError("`scene` of a map must be a Scene, a film, not a Surface")
    picture = isinstance(data, str | os.PathLike) and is_picture(Path(data))
    _refuse_others(options, ("picture", "cube") if picture else ("cube", "picture"))
    if picture:
        return map_picture(data, scene, **options)
    from pellicle.mapping.maps import map_cube

    return map_cube(data, scene, **options)


def _refuse_others(options: Iterable[str], kinds: tuple[str, str]) -> None:
    """Raise UsageError for an argument of `map` that is not for the first of the kinds of data."""
    names = {
        "picture": {*signature(map_picture).parameters},
        "cube": {*_OF_A_CUBE, *signature(read_cube).parameters},
    }
    own, other = kinds
    for name in options:
        if name not in names[own]:
            known = (
                f"is for a {other}, and the data are a {own}" if name in names[other] else "is no argument"
            )
            raise UsageError(f"`{name}` {known}; leave it out")


def compare(
    data: Measurement,
    scenes: Mapping[str, Scene | Surface | Sequence[Scene | Surface]],
    *,
    tolerance: float = 0.0,
    residual: str | None = None,
    progress: Progress = quiet,
) -> Comparison:
    """Fit several scenes to the same data and compare them by AIC and BIC.

    **Arguments:**

    - `data`: as in `pellicle.fit`.
    - `scenes`: two or more descriptions by name, each as `pellicle.fit` takes it.
    - `tolerance`, `residual`, `progress`: as in `pellicle.fit`.

    **Returns:** `Comparison`: each candidate with its fit and criteria, the `best`, and a verdict.

    **Raises:** UsageError for fewer than two scenes, and as `pellicle.fit` does.
    """
    if not isinstance(scenes, Mapping):
        raise UsageError("`scenes` must have names, as in {'oxide': scene, 'nitride': other}")
    options = {"tolerance": tolerance, "residual": residual, "progress": progress}
    return compare_fits({name: fit(data, scene, **options) for name, scene in scenes.items()})


def export(
    scene: Scene | Surface | Fit,
    *,
    to: str,
    path: str | os.PathLike[str],
    numbers: str = "effective",
    thickness_map: ArrayLike | str | os.PathLike[str] | None = None,
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
    - `thickness_map`: thicknesses in nm over the object, (rows, columns) from the upper left, or the path of
      a `.npy` file or a grey image of them ("gltf").
    - `layer`: name of the layer whose thickness it is (the free one, or else the first).

    **Returns:** `Export`: the files, and `material` with both sets of numbers and their errors.

    **Raises:** UsageError for an unknown renderer, for a package that is absent, and for a file that exists;
    ValueError where a material has no data between 380 and 730 nm.
    """
    from pellicle.rendering.export import export as export_film

    return export_film(scene, to, path, numbers=numbers, thickness_map=thickness_map, layer=layer)


def explore(scene: Scene | Surface, *, wavelength: ArrayLike | None = None) -> Any:
    """Show a film in a notebook: sliders beside its spectrum, colour, sphere and plan, which follow them.

    The page is that of `pellicle explore`; it needs no network.

    **Arguments:**

    - `scene`: the film; every number in it that a slider can move has one, free or not.
    - `wavelength`: wavelengths of the plot in nm, (wavelengths,), by default those of the scene's light or
      the visible ones.

    **Returns:** A widget (anywidget): `values` are the sliders' numbers by name, in their units, and setting
    them moves the sliders; `recipe()` is the film in its current state as TOML.

    **Raises:** UsageError without the package anywidget, and for a surface; DataError where the materials
    share no wavelengths.
    """
    from pellicle.explorer.session import Session
    from pellicle.explorer.widget import widget

    check_scene(scene)
    if isinstance(scene, Surface):
        raise UsageError("`scene` must be a Scene: the explorer shows films, and no surfaces")
    return widget(Session(scene, wavelength=wavelength))


def _refuse(kind: str, **arguments: Any) -> None:
    """Raise TypeError where an argument of the other kind of scene is given."""
    for name, value in arguments.items():
        if value is not None:
            raise TypeError(f"`{name}` has no meaning for {kind}")


def _view(surface: Surface, directions: Directions | BrdfSamples | None) -> SurfaceView:
    return surface_view(surface, default_directions() if directions is None else directions)
