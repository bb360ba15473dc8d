"""Section of a surface in the page of a fit: lobes of its BRDF, and a sphere under one lamp."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import direction, frame
from pellicle.brdf.models import model
from pellicle.fitting.result import Fit
from pellicle.programs.cache import kept
from pellicle.rendering.export import with_values
from pellicle.reporting.drawable import CHANNELS, Line, Panel, Section, Table
from pellicle.reporting.figures import rival_label
from pellicle.reporting.page.document import picture
from pellicle.reporting.plotly_figure import figure
from pellicle.reporting.renderings import INCIDENCES, display, png
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface
from pellicle.simulation.environment import EYE, sphere

_LEAVING = np.linspace(-88.0, 88.0, 177)
"""Angles (degrees) to the eye."""
_SIZE, _LAMP = 200, 35.0
"""Pixels across the sphere; angle (degrees) of the lamp from the line of sight, at the upper right."""


class Views(NamedTuple):
    """BRDF (incidences, angles, channels) in the plane of incidence, and radiance (pixels, channels)."""

    lobes: Any
    pixels: Any


@kept
def _views(name: str, numbers: Any, normals: Any) -> Views:
    """Lobes and sphere of a model by its name: one kept program for the fit and its rivals.

    `normals` (pixels, 3) are those of the sphere.
    """
    brdf = model(name)
    o = direction(jnp.abs(_LEAVING), jnp.where(_LEAVING >= 0, 180.0, 0.0))
    i = jnp.stack([jnp.broadcast_to(direction(angle, 0.0), o.shape) for angle in INCIDENCES])
    axes = frame(
        jnp.rad2deg(jnp.arccos(normals[:, 2])), jnp.rad2deg(jnp.arctan2(normals[:, 1], normals[:, 0]))
    )
    light, sight = axes @ direction(_LAMP, 60.0), axes @ jnp.asarray(EYE)
    lit = light[:, 2:] > 0
    above = jnp.where(lit, light, EYE)  # from below the horizon there is no light
    pixels = jnp.where(lit, brdf(numbers, above, sight) * light[:, 2:], 0.0)
    return Views(brdf(numbers, i, jnp.broadcast_to(o, i.shape)), pixels)


def surface_section(fit: Fit) -> dict[str, Any]:
    """The figure of lobes, with those of rivals, and the rendering of a sphere."""
    fitted = {name: p.value for name, p in fit.parameters.items()}
    numbers = [fitted, *(fitted | dict(rival.parameters) for rival in fit.rivals)]
    best, *rivals = (with_values(fit.surface, values) for values in numbers)
    count = fit.surface.channels
    names = ["R", "G", "B"] if count == 3 else [f"channel {i + 1}" for i in range(count)]
    with jax.enable_x64(True):
        lobes, pixels = _seen(best)
        of_rivals = [_seen(own).lobes for own in rivals]
    columns = {"angle to the eye (degrees)": _LEAVING}
    for angle, values in zip(INCIDENCES, lobes, strict=True):
        columns |= {f"{n}, light at {angle:g}°": x for n, x in zip(names, values.T, strict=True)}
    caption = (
        "BRDF of the fitted surface in the plane of incidence, for light at 15, 45 and 70 degrees. Positive"
        " angles to the eye are on the side of the mirror direction."
    )
    others = [
        (f"rival: {rival_label(rival, fit)}", _panels(own, names))
        for rival, own in zip(fit.rivals, of_rivals, strict=True)
    ]
    rows = [[panel] for panel in _panels(lobes, names)]
    section = Section("angle to the eye (degrees)", rows, table=Table(columns))
    return {"lobes": figure("lobes", caption, section, others), "sphere": _sphere(pixels)}


def _panels(lobes: np.ndarray, names: list[str]) -> list[Panel]:
    """A panel for each angle of the light, of `lobes` (incidences, angles, channels)."""
    panels = []
    for angle, values in zip(INCIDENCES, lobes, strict=True):
        lines = [
            Line(_LEAVING, own, name, CHANNELS[c % len(CHANNELS)], model=True)
            for c, (name, own) in enumerate(zip(names, values.T, strict=True))
        ]
        panels.append(Panel(f"light at {angle:g}°", lines, height=1.5))
    return panels


def _seen(surface: Scene | Surface) -> Views:
    assert isinstance(surface, Surface)
    numbers = {key: np.asarray(value, dtype=float) for key, value in surface.start_numbers().items()}
    return _views(surface.model, numbers, sphere(_SIZE).normal)


def _sphere(radiance: np.ndarray) -> dict[str, str]:
    """PNG of the sphere: its three channels as red, green and blue, others as the grey of their mean."""
    rgb = radiance if radiance.shape[1] == 3 else np.repeat(radiance.mean(axis=1, keepdims=True), 3, axis=1)
    about = (
        f"Sphere of the fitted surface under one lamp, {_LAMP:g} degrees from the line of sight, its channels"
        " shown as red, green and blue."
    )
    return picture(png(display(sphere(_SIZE).rendering(rgb))), about)
