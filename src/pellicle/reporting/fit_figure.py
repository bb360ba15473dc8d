"""Figure of a fit: data and model, residuals, misfit against thickness, n and k."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.fitting.curves import BIREFRINGENCE, BrdfCurve, ColourCurve, Curve, Index
from pellicle.fitting.depth_profiles import FittedProfile, fitted_profiles
from pellicle.fitting.status import RIVAL
from pellicle.reporting import (
    brdf_figure,
    fitted_colours,
    generalised_figure,
    intensity_figure,
    mueller_figure,
    psi_delta,
)
from pellicle.reporting.drawing import (
    ABOVE,
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pellicle.fitting.result import Fit, Part, Profile

WIDTH_INCHES = 8.0
_LINE, _AXIS, _GAP = 0.2, 0.55, 0.1
"""Heights in inches: a line of text, an axis with numbers and label, a gap."""
MOST_LABELS = 6
ROOM_FOR_LABEL = 0.025
"""Least distance between two labels, as a share of the axis."""
HOPELESS = 1e7
"""Δχ² from which nothing is worth showing: the search caps it above."""

_LABEL: dict[str, Any] = {
    "rotation": 90,
    "xytext": (0, 6),
    "textcoords": "offset points",
    "ha": "center",
    "va": "bottom",
    "fontsize": "small",
    "bbox": {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.5},
}


class _Panel(NamedTuple):
    """One panel: what draws it, its height in inches, the spectrum whose axis it shares, and how many lines
    of text are above it."""

    draw: Callable[[Axes], None]
    height: float
    part: Part | None = None
    lines_above: int = 0


def draw(fit: Fit) -> Figure:
    """Draw a fit, with panels of its data for each spectrum or set of BRDF samples."""
    if fit.layer_test is not None:
        return brdf_figure.draw(fit)
    panels = [panel for part in fit.parts for panel in _panels_of_data(part)]
    if fit.profile is not None and fit.profile.thickness.size > 1:
        panels.append(_Panel(partial(_misfit, fit=fit), 1.9, lines_above=1))
    if index_is_free(fit):
        panels.append(_Panel(partial(_index, fit=fit), 1.5))
    for profile in fitted_profiles(fit):
        panels.append(_Panel(partial(_against_depth, profile=profile), 1.5))
    figure = new_figure(WIDTH_INCHES, 1.0, constrained=False)
    rows = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for part in fit.parts:
        first, *rest = [axes for axes, panel in zip(rows, panels, strict=True) if panel.part is part]
        # the axes around a grid of panels have no numbers to share
        grid = getattr(part.data, "elements", ()) or getattr(part.data, "ratios", ())
        for axes in () if grid else rest:
            axes.sharex(first)
        if len(fit.parts) > 1:
            first.set_title(part.name.replace("$", r"\$"), fontsize="small", loc="left")
    for panel, axes in zip(panels, rows, strict=True):
        panel.draw(axes)
    _arrange(figure, list(rows), panels, _title(fit))
    return figure


def _arrange(figure: Figure, rows: list[Axes], panels: list[_Panel], title: str) -> None:
    """Place the panels below each other and below the title.

    Matplotlib's constrained layout measures every text twice at each drawing: half of the time of a figure.
    Here heights are those of lines of text, and only the labels beside the panels are measured.
    """
    heights = [panel.height for panel in panels]
    labelled = [axes.xaxis.get_tick_params().get("labelbottom", True) for axes in rows]
    titled = [bool(axes.get_title(loc="left")) for axes in rows]
    above = [_LINE * (panel.lines_above + own) for panel, own in zip(panels, titled, strict=True)]
    below = [_AXIS if shown else _GAP for shown in labelled]
    top = _LINE * (title.count("\n") + 1) + 2 * _GAP
    height = top + sum(above) + sum(heights) + sum(below)
    figure.set_size_inches(WIDTH_INCHES, height)
    figure.suptitle(title, fontsize="medium", x=0.01, y=1 - _GAP / height, ha="left", va="top")
    bottoms = []
    for axes, over, own, under in zip(rows, above, heights, below, strict=True):
        top += over + own
        bottoms.append(1 - top / height)
        axes.set_position((0.1, bottoms[-1], 0.8, own / height))  # the number of ticks depends on the height
        top += under
    renderer: Any = figure.canvas.get_renderer()  # pyright: ignore[reportAttributeAccessIssue]
    left = right = 0.0
    for axes in figure.axes:
        inside = axes.get_window_extent(renderer)
        box = axes.yaxis.get_tightbbox(renderer) or inside
        left, right = max(left, inside.x0 - box.x0), max(right, box.x1 - inside.x1)
    left, right = (room / figure.dpi / WIDTH_INCHES + 0.01 for room in (left, right))
    for axes, bottom, own in zip(rows, bottoms, heights, strict=True):
        axes.set_position((left, bottom, 1 - left - right, own / height))


def _panels_of_data(part: Part) -> list[_Panel]:
    if isinstance(part.curve, ColourCurve):
        rows = [(fitted_colours.patches, 1.6, 0), (fitted_colours.residuals, 1.3, 1)]
    elif isinstance(part.curve, BrdfCurve):
        rows = [(brdf_figure.draw_samples, 3.0, 0), (brdf_figure.draw_residuals, 1.3, 0)]
    elif part.spectrum.ratios:
        rows = [(generalised_figure.ratios, 4.6, 2), (generalised_figure.residuals, 1.5, 2)]
    elif part.spectrum.elements:
        rows = [(mueller_figure.matrix, 5.4, 0), (mueller_figure.residuals, 1.5, 2)]
    elif part.spectral.delta_data is None:
        rows = [(intensity_figure.intensity, 3.0, 0), (intensity_figure.residuals, 1.3, 1)]
    else:
        rows = [(psi_delta.psi, 2.2, 0), (psi_delta.delta, 2.2, 0), (psi_delta.residuals, 1.5, 1)]
        if part.spectral.depolarisation_data is not None:
            rows.insert(2, (psi_delta.depolarisation, 1.5, 0))
    return [_Panel(partial(panel, part=part), height, part, lines) for panel, height, lines in rows]


def _title(fit: Fit) -> str:
    name = " and ".join(name for name in file_names(fit) if name)
    verdict = textwrap.wrap(fit.verdict.replace(" ± ", "\u00a0±\u00a0"), 108, break_on_hyphens=False)
    text = "\n".join([f"{textwrap.shorten(name, 70) or 'fit'}: {fit.status}", *verdict])
    return text.replace("$", r"\$")  # no mathematics in a file's name


def file_names(fit: Fit) -> list[str]:
    """Each file without its folder, and the names of its spectra: `film.dat [psi-delta, Rp]`."""
    files: list[tuple[str, list[str]]] = []
    for part in fit.parts:
        path, name = part.data.path, getattr(part.data, "name", "")
        if name and files and files[-1][0] == path:
            files[-1][1].append(name)
        else:
            files.append((path, [name] if name else []))
    return [
        path.replace("\\", "/").rsplit("/", 1)[-1] + (f" [{', '.join(names)}]" if names else "")
        for path, names in files
    ]


def _misfit(axes: Axes, fit: Fit) -> None:
    """Δχ² against thickness, logarithmic above the threshold that calls a fit ambiguous."""
    assert fit.profile is not None
    minima = minima_of(fit)
    thickness, misfit = completed(fit.profile, minima)
    left, right = span(thickness, misfit)
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
    axes.legend(**ABOVE, ncols=3)


def minima_of(fit: Fit) -> list[tuple[float, float]]:
    """(thickness, Δχ²) of the best fit and its rivals, the best first."""
    name = next((p.name for p in fit.free if p.name.split(".")[-1] == "thickness"), None)
    if name is None:
        return []
    rivals = [(r.parameters[name], r.delta_chi2) for r in fit.rivals if name in r.parameters]
    return [(fit[name].value, 0.0), *sorted(rivals, key=lambda rival: rival[1])]


def completed(profile: Profile, minima: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """The scan with the minima added that lie below it: its grid seldom includes the very minimum."""
    thickness, misfit = profile.thickness, np.maximum(profile.delta_chi2, 0.0)
    below = [(t, delta) for t, delta in minima if delta < np.interp(t, thickness, misfit)]
    thickness = np.concatenate([thickness, [t for t, _ in below]])
    order = np.argsort(thickness, kind="stable")
    return thickness[order], np.concatenate([misfit, [delta for _, delta in below]])[order]


def span(thickness: np.ndarray, misfit: np.ndarray) -> tuple[float, float]:
    """Range of thickness to show: ends whose misfit is hopeless are cut."""
    shown = thickness[misfit < HOPELESS] if np.any(misfit < HOPELESS) else thickness
    margin = 0.03 * float(np.ptp(shown)) or 1.0
    return float(shown.min()) - margin, float(shown.max()) + margin


def _labelled(minima: list[tuple[float, float]], room: float) -> list[tuple[float, float]]:
    """The best minima whose labels do not overlap."""
    chosen: list[tuple[float, float]] = []
    for minimum in minima:
        if len(chosen) < MOST_LABELS and all(abs(minimum[0] - other[0]) > room for other in chosen):
            chosen.append(minimum)
    return chosen


def _scale(axes: Axes, misfit: np.ndarray, minima: list[tuple[float, float]]) -> None:
    """Set a logarithmic axis above the threshold and a linear one below, with room for labels."""
    hopeful = misfit[misfit < HOPELESS]
    heights = [float(np.percentile(hopeful, 95)) if hopeful.size else 0.0, *(delta for _, delta in minima)]
    top = max(10 * RIVAL, *heights)
    ceiling = top * (top / RIVAL) ** 0.6
    decades = int(np.log10(ceiling))
    powers = range(1, decades + 1, 1 + decades // 5)
    axes.set_yscale("symlog", linthresh=RIVAL, linscale=0.8)
    labels = [str(10**i) if i < 4 else f"$10^{{{i}}}$" for i in powers]
    axes.set_yticks([0, *(10.0**i for i in powers)], ["0", *labels])
    axes.set_yticks([], minor=True)
    axes.set_ylim(-2, ceiling)


def index_is_free(fit: Fit) -> bool:
    """True where n or k was fitted and is worth a curve against wavelength."""
    several = fit.index.wavelength.size > 1 or not all(_ellipsometric(part) for part in fit.parts)
    curves = [fit.index, *fit.principal_indices.values()]
    return several and any(bool(np.any(c.n_stderr > 0) or np.any(c.k_stderr > 0)) for c in curves)


def _ellipsometric(part: Part) -> bool:
    return isinstance(part.curve, Curve) and part.spectrum.ellipsometric


def _index(axes: Axes, fit: Fit) -> None:
    principal = {name: x for name, x in fit.principal_indices.items() if name != BIREFRINGENCE}
    if principal:
        _principal(axes, principal)
    else:
        _n_and_k(axes, fit.index.wavelength, fit.index)
    axes.set(xlabel="wavelength (nm)")


def _principal(axes: Axes, indices: Mapping[str, Index]) -> None:
    """n of each principal index on the left axis, k on the right one in the same colours, if any absorbs."""
    absorbing = any(np.any(index.k) or np.any(index.k_stderr > 0) for index in indices.values())
    beside = axes.twinx() if absorbing else None
    for color, (name, index) in zip((BLUE, GREEN, BLACK), indices.items(), strict=False):
        _band(axes, index.wavelength, index.n, index.n_stderr, color, "-", name)
        if beside is not None:
            _band(beside, index.wavelength, index.k, index.k_stderr, color, "--")
    axes.margins(x=0.01)
    axes.set_ylabel("n")
    axes.legend(**{**ABOVE, "ncols": 3}, fontsize="x-small")
    if beside is not None:
        beside.margins(x=0.01)
        beside.set_ylabel("k (dashed)")
        _stretch(axes, below=1.0)
        _stretch(beside, above=1.0)


def _against_depth(axes: Axes, profile: FittedProfile) -> None:
    _n_and_k(axes, profile.depth, profile)
    of = "" if profile.layer == "layer" else f"in {profile.layer} "
    axes.set(xlabel=f"depth {of}(nm), at {profile.wavelength:g} nm".replace("$", r"\$"))


def _n_and_k(axes: Axes, position: np.ndarray, curve: Index | FittedProfile) -> None:
    """n on the left axis; k, if there is any, on the right axis and below n, so that they do not overlap."""
    _band(axes, position, curve.n, curve.n_stderr, BLUE, "-")
    axes.margins(x=0.01)
    axes.set_ylabel("n", color=BLUE)
    if np.any(curve.k) or np.any(curve.k_stderr > 0):
        beside = axes.twinx()
        _band(beside, position, curve.k, curve.k_stderr, ORANGE, "--")
        beside.margins(x=0.01)
        beside.set_ylabel("k (dashed)", color=ORANGE)
        _stretch(axes, below=1.0)
        _stretch(beside, above=1.0)


def _stretch(axes: Axes, below: float = 0.0, above: float = 0.0) -> None:
    """Extend the y axis by shares of its range."""
    low, high = axes.get_ylim()
    axes.set_ylim(low - below * (high - low), high + above * (high - low))


def _band(
    axes: Axes,
    nm: np.ndarray,
    value: np.ndarray,
    stderr: np.ndarray,
    color: str,
    style: str,
    label: str = "_",
) -> None:
    """Draw a line and the band of ± its standard error, where that is finite."""
    order = np.argsort(nm, kind="stable")
    nm, value, stderr = nm[order], value[order], stderr[order]
    axes.fill_between(nm, value - stderr, value + stderr, color=color, alpha=0.25, lw=0)
    axes.plot(nm, value, color=color, linestyle=style, linewidth=1.2, label=label)
