"""Log messages for each step of a fit of spectra.

`pellicle ... --verbose` listens; so does anyone with `logging.getLogger("pellicle").setLevel("INFO")`.
"""

from collections.abc import Sequence
from logging import INFO, getLogger

import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.fitting.film.colour_measurements import MeasuredColours
from pellicle.fitting.film.problem import Target
from pellicle.fitting.problem import Problem
from pellicle.forward_model.plan import Plan
from pellicle.materials import Material
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.layers import Interface, Plate

log = getLogger(__name__)


def log_problem(spectra: Sequence[Target], problem: Problem) -> None:
    """Log the scene, the free parameters, each spectrum with its noise, and its plan."""
    if not log.isEnabledFor(INFO):
        return
    log_scene(spectra[0].scene)
    for p in problem.parameters:
        log.info("free: %s between %g and %g%s", p.name, p.lower, p.upper, f" {p.unit}" if p.unit else "")
    for spectrum, view in zip(spectra, problem.views, strict=True):
        light, nm = spectrum.scene.light, spectrum.wavelength
        at = "free angle" if is_free(light.angle) else f"{_span(np.atleast_1d(light.angle))} degrees"
        size = f"{view.rows} colours" if isinstance(spectrum, MeasuredColours) else f"{len(nm)} points"
        points = f"{light.signal} at {size}, {_span(nm)} nm, {at}, {light.polarisation}"
        noise = "no noise is given: equal weights, and σ from the residuals of the best fit"
        if spectrum.noise.given:
            noise = "its noise is given, and errors are absolute"
        elif spectrum.noise.drifting:
            noise = "no noise is given; scale drifts, so weights are the error that a lamp is allowed"
        log.info("data%s: %s; %s", _of(view.name), points, noise)
        log_plan(view.plan, view.name)


def log_scene(scene: Scene) -> None:
    """Log the layers: `from air: Fe2O3 (main/Fe2O3/Querry-o), 1 to 1000 nm, on BK7 (...)`."""
    if log.isEnabledFor(INFO):
        layers = []
        for layer in scene.layers:
            medium = "a mixed interface" if isinstance(layer, Interface) else medium_in_words(layer.material)
            if isinstance(layer, Plate):
                medium, size, unit = f"a plate of {medium}", layer.plate_mm, "mm"
            else:
                size, unit = layer.thickness, "nm"
            size = f"{size.lower:g} to {size.upper:g}" if is_free(size) else f"{float(size):g}"
            layers.append(f"{medium}, {size} {unit}")
        on, back = medium_in_words(scene.substrate.material), scene.substrate.back
        behind = "" if back is None else f", a plate with {medium_in_words(back)} behind it"
        if back is not None:
            share, count = scene.substrate.back_collected, scene.substrate.back_reflections
            behind += "" if share is None else f", back collected {'free' if is_free(share) else share}"
            behind += "" if count is None else f", back reflections {count}"
        stack = ", then ".join(layers)
        log.info("scene: from %s: %s, on %s%s", medium_in_words(scene.ambient), stack, on, behind)


def log_plan(plan: Plan, name: str = "") -> None:
    """Log each effect that is simulated, with its reason, and those that are not."""
    for row in plan.rows:
        if row.on:
            log.info("plan%s: %s is simulated: %s", _of(name), row.effect, row.why)
    small = [out.effect for out in plan.left_out]
    if small:
        log.info("plan%s: left out within the tolerance %g: %s", _of(name), plan.tolerance, ", ".join(small))
    absent = ", ".join(row.effect for row in plan.rows if not row.on and row.effect not in small)
    log.info("plan%s: absent, so not simulated: %s", _of(name), absent or "nothing")


def medium_in_words(medium: AbstractDispersion) -> str:
    """Describe a medium: a material by name and page, an index by its numbers, others by their type."""
    if isinstance(medium, Material):
        return medium.name if medium.page == medium.name else f"{medium.name} ({medium.page})"
    if isinstance(medium, Constant) and not free_leaves(medium):
        k = 0.0 if medium.k is None else float(medium.k)
        return f"index {float(medium.n):g}{f' + {k:g}i' * bool(k)}"
    inside = [value for value in vars(medium).values() if isinstance(value, AbstractDispersion)]
    of = f" of {' and '.join(medium_in_words(part) for part in inside)}" if inside else ""
    free = ", its numbers free" if free_leaves(medium) else ""
    return f"{type(medium).__name__}{of}{free}"


def _span(values: np.ndarray) -> str:
    low, high = values.min(), values.max()
    return f"{low:g} to {high:g}" if low < high else f"{low:g}"


def _of(name: str) -> str:
    return f" of {name}" if name else ""
