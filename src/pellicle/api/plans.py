"""Verbs of planning: effects that a simulation needs, what accuracy costs in time, what to measure next."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.effects.film_plan import plan as film_plan
from pellicle.effects.surface_plan import plan as surface_plan
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface, SurfaceView, check_scene, refuse, surface_view
from pellicle.simulation.brdf import Directions, default_directions

if TYPE_CHECKING:
    from pellicle.accuracy.registry import Cost
    from pellicle.fitting.planned_measurement import MeasurementPlan
    from pellicle.fitting.result import Fit


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
        return surface_plan(_viewed(scene, directions), tolerance, keep)
    refuse("a Scene", directions=directions)
    if np.ndim(tolerance):
        raise UsageError("`tolerance` is one number; wavelengths belong to the scene, in its pl.Light")
    return film_plan(scene, tolerance, keep)


def cost(
    scene: Scene | Surface,
    wavelength: ArrayLike | None = None,
    *,
    directions: Directions | BrdfSamples | None = None,
    reference: str = "float64",
    tolerance: float | None = None,
    noise: float | None = None,
    datasets: int = 20,
    time_limit: float = 120.0,
    space: str | None = None,
    angle: ArrayLike | None = None,
    progress: Progress = quiet,
) -> Cost:
    """Measure error and time of every method of simulating `scene`, and of fitting it.

    **Arguments:**

    - `scene`: `Scene` or `Surface`. Of a `Surface` only: `directions`, pairs of directions to light and eye,
      as
      in `pellicle.simulate`. Of a `Scene` only: all others but `tolerance` and `progress`.
    - `wavelength`: nm, shape (wavelengths,); by default those of its light, or as in `pellicle.simulate`.
    - `reference`: what errors are measured against: "float64", or "mpmath" with 50 digits.
    - `tolerance`: the error that is small enough. R and T: a fraction, 0.001 by default. Ψ and Δ: degrees on
      the sphere of N, C and S, 0.1 by default. BRDF: mean ΔE2000 of its film's colour, 0.5 by default, or
      relative to its value where it has no such film.
    - `noise`: standard deviation of the spectra that are fitted, as in `pellicle.simulate`; by default the
      tolerance. A noise without a tolerance is the tolerance too.
    - `datasets`: number of simulated spectra that every solver fits; 0 leaves the solvers out. `time_limit`:
      seconds after which no further one is fitted, and then none's intervals are computed, without
      compilation.
    - `space`: a colour space such as "srgb", for the methods of integrating the colours of a film at `angle`
      of incidence in degrees, (angles,): mean ΔE2000 of the observer 1931 under D65, 0.5 by default.
    - `progress`: called with the name of a stage, the number of steps done and their total.

    **Returns:** `Cost`: for each method its error, its time, and whether another one is both faster and more
    accurate.

    **Raises:** UsageError for a tolerance that is not above zero, for a reference that cannot compute the
    scene, for a scene whose signal is 0 everywhere, and for the colours of a surface without colour-science.
    """
    shared = {"tolerance": tolerance, "progress": progress}
    of_spectra = {"reference": reference, "noise": noise, "datasets": datasets, "time_limit": time_limit}
    return _measured(scene, wavelength, directions, (space, angle), of_spectra, shared)


def plan_measurement(
    scenes: Scene | Fit | Sequence[Scene | Fit] | Mapping[str, Scene | Fit],
    wavelength: ArrayLike | None = None,
    *,
    signals: Sequence[str] | None = None,
    angles: Sequence[float] | None = None,
    polarisations: Sequence[str] | None = None,
    noise: float | None = None,
    noise_degrees: float | None = None,
    progress: Progress = quiet,
) -> MeasurementPlan:
    """Find the measurement that decides between rival `scenes`, or that determines the numbers of one best.

    Each rival is simulated and the others are refitted to that, with the systematic effects of a fit
    integrated out: the expected difference of ln Z is that of the worst case, whichever of them is true.

    **Arguments:**

    - `scenes`: `Scene` whose free numbers start where they are supposed to be, or `Fit` of data, whose values
      and errors then count too; for rivals a list of two or more, or a dictionary by name.
    - `wavelength`: nm, shape (wavelengths,), of the measurement; by default those of the fit, or the visible
      ones that every material has data for. A wider range is tried too.
    - `signals`: "R", "T" and "psi-delta", those that can be measured; T needs a substrate with a `back`.
    - `angles`: of incidence in degrees; by default 0 to 75 for R, 0 and 60 for T, 55 to 80 for Ψ and Δ.
    - `polarisations`: of R at oblique incidence; "unpolarised", "s" and "p" by default.
    - `noise`: standard deviation of a point of R and T, 0.002 by default; `noise_degrees`: of Ψ and Δ, 0.03.
    - `progress`: called with the name of a stage, the number of steps done and their total.

    **Returns:** `MeasurementPlan`: its `measurements`, of rivals the most decisive first, with `delta_ln_z`,
    or of one scene with the `errors` of its free numbers; `would_decide`, `best` and a `verdict`.

    **Raises:** UsageError for surfaces, without free numbers, for another signal, and where the media share
    no wavelengths.
    """
    from pellicle.fitting import measurement_plan

    about = wavelength, signals, angles, polarisations, noise, noise_degrees, progress
    return measurement_plan.plan_measurement(scenes, *about)


def _measured(
    scene: Scene | Surface,
    wavelength: ArrayLike | None,
    directions: Directions | BrdfSamples | None,
    colours: tuple[str | None, ArrayLike | None],
    of_spectra: dict[str, Any],
    shared: dict[str, Any],
) -> Cost:
    """Cost of the colours or values of a surface, or of the colours or spectra of a film."""
    from pellicle.accuracy import colour_methods, cost, surface  # cost: a fifth of the time of importing this
    from pellicle.rendering.renderer_methods import RENDERER_METHODS
    from pellicle.sampling.sampled_intervals import SAMPLED_INTERVALS

    check_scene(scene)
    (space, angle), noise = colours, of_spectra["noise"]
    methods = (*colour_methods.COLOUR_METHODS, *RENDERER_METHODS)
    if isinstance(scene, Surface):
        refuse("a Surface", wavelength=wavelength, noise=noise, space=space, angle=angle)
        return surface.cost(_viewed(scene, directions), colours=methods, **shared)
    refuse("a Scene", directions=directions)
    if space is not None:
        refuse("colours", wavelength=wavelength, noise=noise)
        return colour_methods.colour_cost(scene, angle, methods=methods, **shared)
    refuse("spectra, whose angle is that of the scene's light", angle=angle)
    intervals = (*cost.INTERVAL_METHODS, *SAMPLED_INTERVALS)
    return cost.cost(scene, wavelength, interval_methods=intervals, **of_spectra, **shared)


def _viewed(surface: Surface, directions: Directions | BrdfSamples | None) -> SurfaceView:
    """A surface seen in `directions`, by default those of `pellicle.simulate`."""
    return surface_view(surface, default_directions() if directions is None else directions)
