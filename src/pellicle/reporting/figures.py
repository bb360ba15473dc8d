"""Figures of fits and spectra by Matplotlib, and of fits with their rivals by Plotly.

Panels of a fit are the data of each part, the misfit against thickness, n and k, profiles of graded layers.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.curves import BIREFRINGENCE, Curve, Index
from pellicle.fitting.depth_profiles import FittedProfile, fitted_profiles
from pellicle.fitting.result import Fit, Part, Profile, Rival
from pellicle.fitting.status import RIVAL
from pellicle.reporting import data_panels
from pellicle.reporting.drawable import Band, Line, Panel, Section, Style, Table
from pellicle.reporting.matplotlib_figure import draw
from pellicle.reporting.plotly_figure import figure, thinning

if TYPE_CHECKING:
    from matplotlib.figure import Figure


COLUMN_HEIGHT = 0.6
"""Height of a panel of a journal's figure, as a share of that of a report."""
LETTERS = 7.0
"""Size of the letters of a journal's figure in points."""


def draw_fit(fit: Fit, width_mm: float | None = None) -> Figure:
    """Draw data, fit and residuals of each part, misfit against thickness, n and k, and graded layers.

    With a `width_mm`, such as 86 of a journal's column, without title and misfit, in letters of 7 points.
    Raises UsageError for a width in which no panel has room.
    """
    if width_mm is None:
        return draw(sections(fit), title(fit))
    if not 40 <= width_mm <= 400:
        raise UsageError(f"`width_mm` must lie in 40 to 400 mm, got {width_mm:g}")
    from matplotlib import rc_context

    searched = misfit(fit) if fit.layer_test is None else None
    lower = [
        replace(s, rows=[[replace(p, height=p.height * COLUMN_HEIGHT) for p in row] for row in s.rows])
        for s in sections(fit)
        if searched is None or s.abscissa != searched.abscissa
    ]
    with rc_context({"font.size": LETTERS, "lines.linewidth": 1.0, "axes.linewidth": 0.6}):
        return draw(lower, "", width_mm / 25.4)


def draw_spectrum(spectrum: Spectrum) -> Figure:
    """Draw the values against wavelength, with their errors; Ψ, Δ and the depolarisation in panels, Mueller
    elements at their places of the matrix, generalised Ψ above Δ.

    Values at one wavelength are drawn against the angle of incidence, or the azimuth of the sample.
    """
    title = f"{spectrum.path} [{spectrum.name}]" if spectrum.name else spectrum.path
    return draw([data_panels.measured(spectrum)], title)


def rival_label(rival: Rival, fit: Fit) -> str:
    """`thickness 242.87 nm`: the leading parameter of the fit, with a rival's value."""
    name = next(iter([name for name in fit.parameters if name in rival.parameters] or rival.parameters))
    unit = fit.parameters[name].unit if name in fit.parameters else ""
    return f"{name} {rival.parameters[name]:.5g} {unit}".rstrip()


def of_part(fit: Fit, number: int) -> dict[str, Any]:
    """Data, model and residuals of one part, with those of rivals."""
    part = fit.parts[number]
    rivals = [
        (f"rival: {rival_label(rival, fit)}", replace(part, curve=rival.curves[number]))
        for rival in fit.rivals
        if number < len(rival.curves)
    ]
    return _of_parts(part, rivals, number)


def of_candidates(best: Fit, others: Sequence[tuple[str, Fit]], number: int) -> dict[str, Any]:
    """Data, model and residuals of one part of the best fit, with those of other fits of the same data."""
    return _of_parts(best.parts[number], [(name, fit.parts[number]) for name, fit in others], number)


def _of_parts(part: Part, others: Sequence[tuple[str, Part]], number: int) -> dict[str, Any]:
    rivals = [(name, data_panels.fitted(other).panels) for name, other in others]
    step, start = thinning(len(part.curve.model)), f"{part.name}: data" if part.name else "Data"
    thinned = f" One point of {step} is drawn; the CSV file has them all." if step > 1 else ""
    unit = " degrees" if isinstance(part.curve, Curve) and part.curve.delta_data is not None else ""
    caption = f"{start}, fit and residuals (data − fit). The rms residual is {part.rms:.3g}{unit}.{thinned}"
    return figure(f"data-{number}", caption, data_panels.fitted(part), rivals)


def of_misfit(fit: Fit) -> dict[str, Any] | None:
    """Δχ² against thickness with the minima; None where no thickness was scanned."""
    section = misfit(fit)
    if section is None:
        return None
    assert fit.profile is not None
    rivals = [(f"rival: {rival_label(rival, fit)}", [rival_place(fit, rival)]) for rival in fit.rivals]
    count = max(len(section.table.columns["misfit"]) - 1, 0)
    searched = section.abscissa.partition("searched ")[2].removesuffix(")")
    caption = (
        f"Misfit Δχ² against thickness, searched from {searched} nm,"
        f" linear below {RIVAL:g} and logarithmic above. Its minima are the best fit and"
        f" {count or 'no'} rival{'s' * (count != 1)}."
    )
    drawn = figure("misfit", caption, replace(section, abscissa="thickness (nm)"), rivals)
    for trace in (trace for own in drawn["rivals"] for trace in own):
        trace["marker"] |= {"size": 18, "line": {"width": 3}}
        trace["hoverinfo"] = "skip"
    return drawn


def of_index(fit: Fit) -> dict[str, Any] | None:
    """n and k of the layer with the bands of their standard errors; None where both are known."""
    section = index(fit)
    if section is None:
        return None
    rivals = []
    for rival in fit.rivals:
        pairs = zip(fit.parts, rival.curves, strict=False)
        parts = tuple(replace(part, curve=curve) for part, curve in pairs)
        other = index_panels(replace(fit, parts=parts)) if rival.curves else []
        rivals.append((f"rival: {rival_label(rival, fit)}", other[: len(section.rows)]))
    size = len(fit.index.wavelength)
    caption = f"n and k of the layer at {size} wavelengths, with bands of ± one standard error."
    return figure("index", caption, section, rivals)


MOST_LABELS = 6
ROOM_FOR_LABEL = 0.025
"""Least distance between two labels, as a share of the axis."""
HOPELESS = 1e7
"""Δχ² from which nothing is worth showing: the search caps it above."""
_INDICES = ("index-n", "index-k", "fourth")
"""Colours of the principal indices."""


def sections(fit: Fit) -> list[Section]:
    """All panels of a fit, those of each part first."""
    parts = [data_panels.fitted(part) for part in fit.parts]
    if fit.layer_test is not None:
        return parts
    sections = [*parts, *filter(None, (misfit(fit), index(fit)))]
    for profile in fitted_profiles(fit):  # n and k of a graded layer against depth
        layer = "" if profile.layer == "layer" else f"in {profile.layer} "
        panels = [[panel] for panel in _n_and_k({"": profile}, "depth")]
        sections.append(Section(f"depth {layer}(nm), at {profile.wavelength:g} nm", panels))
    return sections


def title(fit: Fit) -> str:
    """File, status and verdict, in lines."""
    if fit.layer_test is not None:
        return f"{fit.surface.model}: {fit.status}"
    name = " and ".join(name for name in file_names(fit) if name)
    verdict = textwrap.wrap(fit.verdict.replace(" ± ", "\u00a0±\u00a0"), 108, break_on_hyphens=False)
    return "\n".join([f"{textwrap.shorten(name, 70) or 'fit'}: {fit.status}", *verdict])


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


def misfit(fit: Fit) -> Section | None:
    """Δχ² against thickness, logarithmic above the threshold that calls a fit ambiguous; None where no
    thickness was scanned."""
    if fit.profile is None or fit.profile.thickness.size < 2:
        return None
    name = _thickness(fit)
    rivals = [(i, rival) for i, rival in enumerate(fit.rivals) if name in rival.parameters]
    places = [(rival.parameters[name], rival.delta_chi2) for _, rival in rivals]
    minima = [] if not name else [(fit[name].value, 0.0), *sorted(places, key=lambda place: place[1])]
    thickness, delta = completed(fit.profile, minima)
    hopeful = delta < HOPELESS
    shown = thickness[hopeful] if np.any(hopeful) else thickness  # ends whose misfit is hopeless are cut
    margin = 0.03 * float(np.ptp(shown)) or 1.0
    span = float(shown.min()) - margin, float(shown.max()) + margin
    lines = [
        Line(thickness, delta, "misfit", "data", width=0.9, listed=False),
        Line(np.array(span), np.full(2, RIVAL), f"ambiguous below {RIVAL:g}", "blue", "dotted", 0.8),
    ]
    if minima:
        lines.append(_minima(minima[:1], "best", "fit", "circle", [("best fit: show it alone", None)]))
    if rivals:
        clicks = [("click to see its curve", i if r.curves else None) for i, r in rivals]
        lines.append(_minima(places, "rivals", "rival", "diamond", clicks))
    heights = [float(np.percentile(delta[hopeful], 95)) if hopeful.any() else 0.0, *(y for _, y in minima)]
    top = max(10 * RIVAL, *heights)
    panel = Panel(
        "misfit Δχ²",
        lines,
        height=1.9,
        legend="above",
        scale="symlog",
        threshold=RIVAL,
        limits=(-2.0, top * (top / RIVAL) ** 0.6),  # with room for labels
        span=span,
        notes=_labelled(minima, ROOM_FOR_LABEL * (span[1] - span[0])),
    )
    label = f"thickness (nm; searched {thickness.min():.5g} to {thickness.max():.5g})"
    table = {"thickness (nm)": [nm for nm, _ in minima], "misfit": [delta for _, delta in minima]}
    return Section(label, [[panel]], table=Table(table))


def _thickness(fit: Fit) -> str:
    """Name of the first free thickness, empty where there is none."""
    return next((p.name for p in fit.free if p.name.split(".")[-1] == "thickness"), "")


def _minima(
    places: list[tuple[float, float]],
    name: str,
    colour: str,
    style: Style,
    clicks: list[tuple[str, int | None]],
) -> Line:
    rows = zip(places, clicks, strict=True)
    hints = [f"{nm:.5g} nm: Δχ² {delta:.3g}<br>{hint}" for (nm, delta), (hint, _) in rows]
    links = [{"rival": rival} for _, rival in clicks]
    x, y = np.transpose(places)
    return Line(x, y, name, colour, style, hints=hints, links=links)


def rival_place(fit: Fit, rival: Rival) -> Panel:
    """A ring around a rival's minimum, in the panel of the misfit."""
    name = _thickness(fit)
    if name not in rival.parameters:
        return Panel("")
    x, y = np.array([rival.parameters[name]]), np.array([rival.delta_chi2])
    return Panel("", [Line(x, y, "", "rival", "ring", 18, model=True)], scale="symlog", threshold=RIVAL)


def completed(profile: Profile, minima: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """The scan with the minima added that lie below it: its grid seldom includes the very minimum."""
    thickness, delta_chi2 = profile.thickness, np.maximum(profile.delta_chi2, 0.0)
    below = [(nm, delta) for nm, delta in minima if delta < np.interp(nm, thickness, delta_chi2)]
    thickness = np.concatenate([thickness, [nm for nm, _ in below]])
    order = np.argsort(thickness, kind="stable")
    return thickness[order], np.concatenate([delta_chi2, [delta for _, delta in below]])[order]


def _labelled(minima: list[tuple[float, float]], room: float) -> list[tuple[float, float, str]]:
    """Labels of the best minima that do not overlap."""
    chosen: list[tuple[float, float, str]] = []
    for nm, delta in minima:
        if len(chosen) < MOST_LABELS and all(abs(nm - other) > room for other, *_ in chosen):
            chosen.append((nm, delta, f"{nm:.5g}"))
    return chosen


def index_is_free(fit: Fit) -> bool:
    """True where n or k was fitted and is worth a curve against wavelength."""
    ellipsometric = (isinstance(p.curve, Curve) and p.spectrum.ellipsometric for p in fit.parts)
    several = fit.index.wavelength.size > 1 or not all(ellipsometric)
    curves = [fit.index, *fit.principal_indices.values()]
    return several and any(bool(np.any(c.n_stderr > 0) or np.any(c.k_stderr > 0)) for c in curves)


def index(fit: Fit) -> Section | None:
    """n and k of the layer with the bands of their standard errors; None where both are known.

    Of a birefringent layer the principal indices share panels, and the birefringence has one of its own.
    """
    if fit.layer_test is not None or not index_is_free(fit):
        return None
    table = {"wavelength (nm)": fit.index.wavelength}
    for which, curve in (fit.principal_indices or {"": fit.index}).items():
        for name in ("n", "k"):
            column = f"{which} {name}".strip()
            table |= {column: getattr(curve, name), f"error of {column}": getattr(curve, f"{name}_stderr")}
    return Section("wavelength (nm)", [[panel] for panel in index_panels(fit)], table=Table(table))


def index_panels(fit: Fit) -> list[Panel]:
    """Panels of n, of k if the layer absorbs, and of a birefringence."""
    curves = dict(fit.principal_indices) or {"": fit.index}
    birefringence = curves.pop(BIREFRINGENCE, None)
    panels = _n_and_k(curves, "wavelength")
    if birefringence is not None:
        [panel] = _n_and_k({"": birefringence}, "wavelength", extinction=False)
        panels.append(replace(panel, label=BIREFRINGENCE))
    return panels


def _n_and_k(
    curves: Mapping[str, Index | FittedProfile], position: str, extinction: bool | None = None
) -> list[Panel]:
    """A panel of n, and one of k if a curve absorbs, with bands of ± the standard error."""
    absorbs = any(bool(np.any(c.k) or np.any(c.k_stderr > 0)) for c in curves.values())
    panels = []
    for letter in ("n", "k") if (absorbs if extinction is None else extinction) else ("n",):
        lines, bands = [], []
        colours = _INDICES if len(curves) > 1 else (f"index-{letter}",)
        for colour, (which, curve) in zip(colours, curves.items(), strict=False):
            columns = [getattr(curve, name) for name in (position, letter, f"{letter}_stderr")]
            x, value, error = np.take(columns, np.argsort(columns[0], kind="stable"), axis=1)
            name = which or letter
            lines.append(Line(x, value, name, colour, width=1.2, listed=bool(which), model=True))
            about = f"± error of {name}", colour, 0.25
            low = np.maximum(value - error, 0.0) if letter == "k" else value - error
            bands.append(Band(x, low, value + error, *about, listed=False))
        panels.append(Panel(letter, lines, bands, 1.3, legend="above" if len(curves) > 1 else ""))
    return panels
