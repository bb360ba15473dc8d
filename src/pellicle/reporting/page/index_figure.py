"""Interactive figure of a fitted layer: n and k against wavelength with their errors."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.curves import BIREFRINGENCE
from pellicle.reporting import fit_figure
from pellicle.reporting.page.data_figures import label
from pellicle.reporting.page.figure import Column, Panel, band, figure, line

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit


def of_index(fit: Fit) -> dict[str, Any] | None:
    """n and k of the layer with the bands of their standard errors; None where both are known."""
    if fit.layer_test is not None or not fit_figure.index_is_free(fit):
        return None
    curve = fit.index
    panels = _fit_panels(fit, errors=True)
    size = len(curve.wavelength)
    rivals = []
    for rival in fit.rivals:
        own = replace(
            fit, parts=tuple(replace(p, curve=c) for p, c in zip(fit.parts, rival.curves, strict=False))
        )
        panel = _fit_panels(own, errors=False)[: len(panels)] if rival.curves else []
        rivals.append((f"rival: {escape(label(rival, fit))}", panel))
    columns = [Column("wavelength (nm)", curve.wavelength)]
    for which, index in (fit.principal_indices or {"": curve}).items():
        for name in ("n", "k"):
            title = f"{which} {name}".strip()
            columns += [
                Column(title, getattr(index, name)),
                Column(f"error of {title}", getattr(index, f"{name}_stderr")),
            ]
    caption = f"n and k of the layer at {size} wavelengths, with bands of ± one standard error."
    return figure("index", caption, "wavelength (nm)", panels, columns, rivals)


def _fit_panels(fit: Fit, errors: bool) -> list[Panel]:
    """Panels of n and k; of a birefringent layer those of each principal index and the birefringence."""
    if not fit.principal_indices:
        return _index_panels(fit.index, errors)
    absorbs = any(_absorbs(index) for index in fit.principal_indices.values())
    return [
        panel._replace(label=f"{panel.label}, {name}")
        for name, index in fit.principal_indices.items()
        for panel in _index_panels(index, errors, absorbs and name != BIREFRINGENCE)
    ]


def _absorbs(index: Any) -> bool:
    return bool(np.any(index.k) or np.any(index.k_stderr > 0))


def _index_panels(curve: Any, errors: bool, absorbs: bool | None = None) -> list[Panel]:
    panels, nm = [], curve.wavelength
    absorbs = _absorbs(curve) if absorbs is None else absorbs
    for name, height in (("n", 180), ("k", 180))[: 1 + absorbs]:
        value, stderr = getattr(curve, name), getattr(curve, f"{name}_stderr")
        bands = []
        if errors:
            bands = [band(nm, value - stderr, value + stderr, f"± error of {name}", f"var(--band-{name})")]
        whole = [np.arange(len(nm))]
        panels.append(Panel(name, height, bands, [line(nm, value, whole, name, f"var(--index-{name})")]))
    return panels
