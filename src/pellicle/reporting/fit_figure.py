"""The figure of a fit: data and model, residuals, the misfit against thickness, n and k."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.result import Fit, Profile
from pellicle.fitting.status import RIVAL
from pellicle.reporting import psi_delta
from pellicle.reporting.drawing import BLACK, BLUE, FITTED, GAP, GREY, ORANGE, blank, marker_size, saved

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
WIDTH_INCHES = 8.0
MOST_LABELS = 6
ROOM_FOR_LABEL = 0.025
"""Least distance between two labels, as a share of the axis."""
HOPELESS = 1e7
"""Δχ² from which nothing is worth showing: the search caps it above."""

Panel = tuple[Callable[["Axes", Fit], None], float]
"""What draws a panel, and its height in inches."""

_LABEL: dict[str, Any] = {
    "rotation": 90,
    "xytext": (0, 6),
    "textcoords": "offset points",
    "ha": "center",
    "va": "bottom",
    "fontsize": "small",
    "bbox": {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.5},
}
_SIGNALS = {"R": "reflectance", "T": "transmittance"}


def figure(fit: Fit, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Draw a fit into `path` (.png, .pdf or .svg), which is returned.

    The file appears complete or not at all. Raises UsageError where it exists, without `overwrite`,
    or cannot be written.
    """
    return saved(draw(fit), path, overwrite=overwrite, dpi=DPI)


def draw(fit: Fit) -> Figure:
    """The figure itself, bound to no window and to no global state."""
    panels: list[tuple[Callable[[Axes, Fit], None], float, Fit]] = []
    for part in fit.parts:
        alone = fit.alone(part)
        panels += [(panel, height, alone) for panel, height in _signal(alone)]
    of_data = len(panels)
    if fit.profile is not None and fit.profile.thickness.size > 1:
        panels.append((_misfit, 1.9, fit))
    if _index_is_free(fit):
        panels.append((_index, 1.5, fit))
    heights = [height for _, height, _ in panels]
    drawn = blank(WIDTH_INCHES, sum(heights) + 1.2)
    axes = drawn.subplots(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for above, below, one, other in zip(axes, axes[1:of_data], panels, panels[1:of_data], strict=False):
        if one[2] is other[2]:
            below.sharex(above)
    for (panel, _, shown), at in zip(panels, axes, strict=True):
        panel(at, shown)
    _name_parts(fit, list(axes[:of_data]), [shown for _, _, shown in panels[:of_data]])
    drawn.suptitle(_title(fit), fontsize="medium", x=0.01, ha="left")
    return drawn


def _signal(fit: Fit) -> list[Panel]:
    """The panels that share the axis of the data."""
    if fit.curve.delta_data is None:
        return [(_data, 3.0), (_residuals, 1.3)]
    return [(psi_delta.psi, 2.2), (psi_delta.delta, 2.2), (psi_delta.residuals, 1.5)]


def _name_parts(fit: Fit, axes: list[Axes], shown: list[Fit]) -> None:
    """The name of each of several spectra over its first panel."""
    if len(fit.parts) == 1:
        return
    for part in fit.parts:
        first = next(at for at, of in zip(axes, shown, strict=True) if of.parts[0] is part)
        first.set_title(part.name.replace("$", r"\$"), fontsize="small", loc="left")


def _title(fit: Fit) -> str:
    name = " and ".join(part.spectrum.path.replace("\\", "/").rsplit("/", 1)[-1] for part in fit.parts)
    verdict = textwrap.wrap(fit.verdict.replace(" ± ", "\u00a0±\u00a0"), 108, break_on_hyphens=False)
    text = "\n".join([f"{textwrap.shorten(name, 70) or 'spectrum'}: {fit.status}", *verdict])
    return text.replace("$", r"\$")  # no mathematics in a file's name


def _series(fit: Fit) -> list[np.ndarray]:
    """The points that one line joins: of one angle of incidence, without a wide gap."""
    nm, angle = fit.curve.wavelength, fit.spectrum.angle
    parts = []
    for value in [None] if angle is None else np.unique(angle):
        points = np.arange(nm.size) if value is None else np.flatnonzero(angle == value)
        steps = np.diff(nm[points])
        gaps = np.flatnonzero(steps > GAP * np.median(steps)) if steps.size else []
        parts += np.split(points, np.asarray(gaps, dtype=int) + 1)
    return parts


def _data(axes: Axes, fit: Fit) -> None:
    curve = fit.curve
    size = marker_size(curve.wavelength.size)
    axes.plot(curve.wavelength, curve.data, ".", color=GREY, markersize=size, label="data")
    for i, part in enumerate(_series(fit)):
        axes.plot(curve.wavelength[part], curve.model[part], **FITTED, label="_" if i else "fit")
    kind = _SIGNALS.get(fit.spectrum.signal) or str(fit.spectrum.signal)
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
    axes.legend(loc="upper right", edgecolor="none")


def _misfit(axes: Axes, fit: Fit) -> None:
    """Δχ² against thickness, logarithmic above the threshold that calls a fit ambiguous."""
    assert fit.profile is not None
    minima = _minima(fit)
    thickness, misfit = _completed(fit.profile, minima)
    left, right = _span(thickness, misfit)
    axes.plot(thickness, misfit, color=GREY, linewidth=0.9)
    axes.axhline(RIVAL, color=BLUE, linewidth=0.8, linestyle=":", label=f"ambiguous below {RIVAL:g}")
    if minima:
        axes.plot(*minima[0], "o", color=ORANGE, label="best")
    if minima[1:]:
        axes.plot(*np.transpose(minima[1:]), "D", color=BLUE, markersize=4, label="rivals")
    for minimum in _labelled(minima, ROOM_FOR_LABEL * (right - left)):
        axes.annotate(f"{minimum[0]:.5g}", minimum, **_LABEL)
    _scale(axes, misfit, minima)
    searched = f"searched {thickness.min():.5g} to {thickness.max():.5g}"
    axes.set(xlabel=f"thickness (nm; {searched})", ylabel="misfit Δχ²", xlim=(left, right))
    axes.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0)


def _minima(fit: Fit) -> list[tuple[float, float]]:
    """(thickness, Δχ²) of the best fit and its rivals, best first."""
    name = next((p.name for p in fit.free if p.name.split(".")[-1] == "thickness"), None)
    if name is None:
        return []
    rivals = [(r.parameters[name], r.delta_chi2) for r in fit.rivals if name in r.parameters]
    return [(fit[name].value, 0.0), *sorted(rivals, key=lambda rival: rival[1])]


def _completed(profile: Profile, minima: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """The scan with the minima that lie below it: its grid seldom meets the bottom of a valley."""
    thickness, misfit = profile.thickness, np.maximum(profile.delta_chi2, 0.0)
    below = [(t, delta) for t, delta in minima if delta < np.interp(t, thickness, misfit)]
    thickness = np.concatenate([thickness, [t for t, _ in below]])
    order = np.argsort(thickness, kind="stable")
    return thickness[order], np.concatenate([misfit, [delta for _, delta in below]])[order]


def _span(thickness: np.ndarray, misfit: np.ndarray) -> tuple[float, float]:
    """The thicknesses worth showing: all but hopeless ends."""
    shown = thickness[misfit < HOPELESS] if np.any(misfit < HOPELESS) else thickness
    margin = 0.03 * float(np.ptp(shown)) or 1.0
    return float(shown.min()) - margin, float(shown.max()) + margin


def _labelled(minima: list[tuple[float, float]], room: float) -> list[tuple[float, float]]:
    """The best minima, as many as leave room for each other's labels."""
    chosen: list[tuple[float, float]] = []
    for minimum in minima:
        if len(chosen) < MOST_LABELS and all(abs(minimum[0] - other[0]) > room for other in chosen):
            chosen.append(minimum)
    return chosen


def _scale(axes: Axes, misfit: np.ndarray, minima: list[tuple[float, float]]) -> None:
    """A logarithmic axis from the threshold up, linear below, with room for labels over the markers."""
    hopeful = misfit[misfit < HOPELESS]
    heights = [float(np.percentile(hopeful, 95)) if hopeful.size else 0.0, *(delta for _, delta in minima)]
    top = max(10 * RIVAL, *heights)
    ceiling = top * (top / RIVAL) ** 0.6
    decades = int(np.log10(ceiling))
    powers = range(1, decades + 1, 1 + decades // 5)
    axes.set_yscale("symlog", linthresh=RIVAL, linscale=0.8)
    axes.set_yticks([0, *(10.0**i for i in powers)], ["0", *(_power(i) for i in powers)])
    axes.set_yticks([], minor=True)
    axes.set_ylim(-2, ceiling)


def _power(exponent: int) -> str:
    return str(10**exponent) if exponent < 4 else f"$10^{{{exponent}}}$"


def _index_is_free(fit: Fit) -> bool:
    several = any(part.spectral.delta_data is None for part in fit.parts) or fit.index.wavelength.size > 1
    return several and bool(np.any(fit.index.n_stderr > 0) or np.any(fit.index.k_stderr > 0))


def _index(axes: Axes, fit: Fit) -> None:
    """n on the left; k, if there is any, on the right and below n, so that their bands stay apart."""
    curve = fit.index
    _band(axes, curve.wavelength, curve.n, curve.n_stderr, BLUE, "-")
    axes.set(xlabel="wavelength (nm)")
    axes.margins(x=0.01)
    axes.set_ylabel("n", color=BLUE)
    if np.any(curve.k) or np.any(curve.k_stderr > 0):
        beside = axes.twinx()
        _band(beside, curve.wavelength, curve.k, curve.k_stderr, ORANGE, "--")
        beside.margins(x=0.01)
        beside.set_ylabel("k (dashed)", color=ORANGE)
        _stretch(axes, below=1.0)
        _stretch(beside, above=1.0)


def _stretch(axes: Axes, below: float = 0.0, above: float = 0.0) -> None:
    """Add empty room, as a share of what is shown."""
    low, high = axes.get_ylim()
    axes.set_ylim(low - below * (high - low), high + above * (high - low))


def _band(axes: Axes, nm: np.ndarray, value: np.ndarray, stderr: np.ndarray, color: str, style: str) -> None:
    """A line and ± its standard error; fill_between leaves out what is not finite."""
    order = np.argsort(nm, kind="stable")
    nm, value, stderr = nm[order], value[order], stderr[order]
    axes.fill_between(nm, value - stderr, value + stderr, color=color, alpha=0.25, lw=0)
    axes.plot(nm, value, color=color, linestyle=style, linewidth=1.2)
