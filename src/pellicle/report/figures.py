"""The figure of a fit: data and model, residuals, the misfit against thickness, n and k."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.fitting.result import Fit, Profile
from pellicle.fitting.status import RIVAL
from pellicle.io.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLACK, ORANGE, BLUE, GREEN, GREY = "#000000", "#D55E00", "#0072B2", "#009E73", "#777777"
"""Okabe and Ito's colours, which the colour-blind tell apart."""
FITTED = {"color": ORANGE, "linewidth": 1.4}
DPI = 150
WIDTH_INCHES = 8.0
MOST_LABELS = 5
ROOM_FOR_LABEL = 0.09
"""Least distance between two labels, as a share of the axis."""

_SIGNALS = {"R": "reflectance", "T": "transmittance"}


def figure(fit: Fit, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Draw a fit into `path` (.png, .pdf or .svg), which is returned.

    The file appears complete or not at all. Raises UsageError where it exists, without `overwrite`,
    or cannot be written.
    """
    target = Path(path)
    with replacing(target, overwrite=overwrite) as draft:
        draw(fit).savefig(draft, dpi=DPI)
    return target


def draw(fit: Fit) -> Figure:
    """The figure itself, bound to no window and to no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels: list[tuple[Callable[[Axes, Fit], None], float]] = [(_data, 3.0), (_residuals, 1.3)]
    if fit.profile is not None and fit.profile.thickness.size > 1:
        panels.append((_misfit, 1.9))
    if _index_is_free(fit):
        panels.append((_index, 1.5))
    heights = [height for _, height in panels]
    drawn = Figure(figsize=(WIDTH_INCHES, sum(heights) + 1.2), layout="constrained")
    FigureCanvasAgg(drawn)
    axes = drawn.subplots(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    axes[1].sharex(axes[0])
    for (panel, _), at in zip(panels, axes, strict=True):
        panel(at, fit)
    drawn.suptitle(_title(fit), fontsize="medium", x=0.01, ha="left")
    return drawn


def _title(fit: Fit) -> str:
    name = fit.spectrum.path.replace("\\", "/").rsplit("/", 1)[-1]
    verdict = textwrap.wrap(fit.verdict, 100, break_on_hyphens=False)
    text = "\n".join([f"{textwrap.shorten(name, 70) or 'spectrum'}: {fit.status}", *verdict])
    return text.replace("$", r"\$")  # no mathematics in a file's name


def _series(fit: Fit) -> Iterator[slice | np.ndarray]:
    """The points of each angle of incidence: one line each."""
    angle = fit.spectrum.angle
    if angle is None:
        yield slice(None)
        return
    for value in np.unique(angle):
        yield np.flatnonzero(angle == value)


def _data(axes: Axes, fit: Fit) -> None:
    curve = fit.curve
    size = float(np.clip(900 / max(curve.wavelength.size, 1), 1.5, 4.0))
    axes.plot(curve.wavelength, curve.data, ".", color=GREY, markersize=size, label="data")
    for i, part in enumerate(_series(fit)):
        axes.plot(curve.wavelength[part], curve.model[part], **FITTED, label="_" if i else "fit")
    kind: str = _SIGNALS.get(fit.spectrum.signal, fit.spectrum.signal)
    axes.set_ylabel(kind if fit.spectrum.calibrated else f"{kind} × unknown scale")
    axes.tick_params(labelbottom=False)
    axes.legend(frameon=False, markerscale=3)
    axes.margins(x=0.01)


def _residuals(axes: Axes, fit: Fit) -> None:
    curve = fit.curve
    for i, part in enumerate(_series(fit)):
        nm, sigma = curve.wavelength[part], curve.sigma[part]
        axes.fill_between(nm, -sigma, sigma, color=BLUE, alpha=0.2, lw=0, label="_" if i else "±σ")
        axes.plot(nm, curve.residual[part], color=BLACK, linewidth=0.8)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel="wavelength (nm)", ylabel="data − fit")
    axes.legend(frameon=False, loc="upper right")


def _misfit(axes: Axes, fit: Fit) -> None:
    """Δχ² against thickness, logarithmic above the threshold that calls a fit ambiguous."""
    profile = fit.profile
    assert profile is not None
    axes.plot(profile.thickness, np.maximum(profile.delta_chi2, 0), color=GREY, linewidth=0.9)
    axes.axhline(RIVAL, color=BLUE, linewidth=0.8, linestyle=":", label=f"ambiguous below {RIVAL:g}")
    minima = _minima(fit)
    axes.plot(*np.transpose(minima[:1]), "o", color=ORANGE, label="best")
    if minima[1:]:
        axes.plot(*np.transpose(minima[1:]), "D", color=BLUE, markersize=5, label="rivals")
    low, high = profile.thickness.min(), profile.thickness.max()
    for thickness, delta in _labelled(minima, low, high):
        _label(axes, thickness, delta, (thickness - low) / (high - low))
    axes.set_yscale("symlog", linthresh=RIVAL, linscale=0.8)
    axes.set(xlabel="thickness (nm)", ylabel="Δχ² (effective points)", ylim=(-2, _top(profile, minima)))
    axes.margins(x=0.01)
    axes.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0)


def _minima(fit: Fit) -> list[tuple[float, float]]:
    """(thickness, Δχ²) of the best fit and its rivals, best first."""
    name = next((p.name for p in fit.free if p.name.split(".")[-1] == "thickness"), None)
    if name is None:
        return []
    rivals = [(r.parameters[name], r.delta_chi2) for r in fit.rivals if name in r.parameters]
    return [(fit[name].value, 0.0), *sorted(rivals, key=lambda rival: rival[1])]


def _labelled(minima: list[tuple[float, float]], low: float, high: float) -> list[tuple[float, float]]:
    """The best minima, as many as leave room for each other's labels."""
    chosen: list[tuple[float, float]] = []
    for minimum in minima:
        near = (abs(minimum[0] - other[0]) for other in chosen)
        if len(chosen) < MOST_LABELS and all(gap > ROOM_FOR_LABEL * (high - low) for gap in near):
            chosen.append(minimum)
    return chosen


def _label(axes: Axes, thickness: float, delta: float, place: float) -> None:
    side = "right" if place > 0.9 else "left"
    axes.annotate(
        f"{thickness:.5g}",
        (thickness, delta),
        xytext=(-6 if side == "right" else 6, 0),
        textcoords="offset points",
        ha=side,
        va="center",
        fontsize="small",
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.5},
    )


def _top(profile: Profile, minima: list[tuple[float, float]]) -> float:
    """The top of the axis: above the walls between the minima, not at the few hopeless thicknesses."""
    heights = [float(np.percentile(profile.delta_chi2, 95)), *(delta for _, delta in minima)]
    return 3 * max(2 * RIVAL, *heights)


def _index_is_free(fit: Fit) -> bool:
    return bool(np.any(fit.curve.n_stderr > 0) or np.any(fit.curve.k_stderr > 0))


def _index(axes: Axes, fit: Fit) -> None:
    curve = fit.curve
    _band(axes, curve.wavelength, curve.n, curve.n_stderr, BLUE, "-")
    axes.set(xlabel="wavelength (nm)")
    axes.set_ylabel("n", color=BLUE)
    if np.any(curve.k) or np.any(curve.k_stderr > 0):
        beside = axes.twinx()
        _band(beside, curve.wavelength, curve.k, curve.k_stderr, ORANGE, "--")
        beside.set_ylabel("k (dashed)", color=ORANGE)
    axes.margins(x=0.01)


def _band(axes: Axes, nm: np.ndarray, value: np.ndarray, stderr: np.ndarray, color: str, style: str) -> None:
    """A line and ± its standard error, where that is finite."""
    order = np.argsort(nm, kind="stable")
    nm, value, stderr = nm[order], value[order], stderr[order]
    error = np.where(np.isfinite(stderr), stderr, np.nan)
    axes.fill_between(nm, value - error, value + error, color=color, alpha=0.25, lw=0)
    axes.plot(nm, value, color=color, linestyle=style, linewidth=1.2)
