"""Series: report, JSON record, table, figure, page and folder of a film against time."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import replacing, write_text
from pellicle.fitting.batch.data import STATUSES
from pellicle.fitting.status import with_error
from pellicle.mapping.growth import TIME
from pellicle.mapping.series_residuals import SHOWN, WAVELENGTH, WORST
from pellicle.mapping.series_result import Series
from pellicle.reporting import matplotlib_figure
from pellicle.reporting.drawable import Band, Line, Panel, Raster, Section, Table, labelled
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.json_record import strict, versions, write_result
from pellicle.reporting.map_summary import is_decided, summarise
from pellicle.reporting.map_text import ADVICE, plan_rows
from pellicle.reporting.page.document import Table as PageTable
from pellicle.reporting.page.document import page, picture
from pellicle.reporting.plain_text import blocks_of, csv_text, facts, wrapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

SCHEMA = "pellicle.series/1"
NETCDF, CSV, FIGURE = "series.nc", "series.csv", "series.png"
_SPELLED = {"s": "seconds", "min": "minutes", "h": "hours", "d": "days"}
_ERRORS = (
    "The standard error (`stderr`) contains effects that all times have in common, such as the error of an"
    " index: use it for a thickness. Changes from time to time have the error of the noise alone"
    " (`stderr_noise`), of all times together."
)


def report(series: Series) -> str:
    """Format a series as text: the statuses, values and rates, breaks and gaps."""
    return blocks_of(
        [
            ("Series", [*wrapped(_sentence(series)), *facts(_file_rows(series))]),
            ("Parameters", facts(_value_rows(series))),
            ("Warnings", [line for text in series.warnings for line in wrapped(text, "- ", "  ")]),
            ("Status: what to do", facts(_status_rows(series))),
            ("Errors", wrapped(_ERRORS)),
        ]
    )


def to_json(series: Series) -> dict[str, Any]:
    """Convert to the dictionary of the record; values of all times are in the table and the NetCDF file."""
    data = series.dataset
    shared = [str(name) for name in data.data_vars if not data[name].dims and f"{name}_stderr" in data]
    return strict(
        {
            "schema": SCHEMA,
            "data": {"path": series.map.input},
            "summary": _sentence(series),
            "times": {"count": len(series.times), "unit": _unit(series), "values": series.times}
            | ({"start": start} if (start := data[TIME].attrs.get("start")) else {}),
            "status": series.status,
            "parameters": {
                name: {
                    "value": float(data[name]),
                    "stderr": float(data[f"{name}_stderr"]),
                    "stderr_noise": float(data[f"{name}_stderr_noise"]),
                    "unit": data[name].attrs["units"],
                }
                for name in shared
            },
            "breaks": list(series.breaks),
            "warnings": list(series.warnings),
            "versions": versions(),
        }
    )


def write_series(
    folder: str | os.PathLike[str], series: Series, again: Sequence[tuple[str, str]] = ()
) -> Path:
    """Write series.nc, series.csv, result.json, report and figure into a folder, and return it.

    `again` is what repeats it: descriptions and texts.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    figure = draw(series)
    image = io.BytesIO()
    figure.savefig(image, format="png")
    contents: dict[str, Any] = {REPORT: report(series), CSV: csv_text(_table(series)), FIGURE: figure}
    target = write_result(folder, to_json(series), contents)
    with replacing(target / NETCDF, overwrite=True) as draft:
        dated(series.dataset).to_netcdf(draft, engine="h5netcdf")
    write_text(target / PAGE, _page(series, image.getvalue(), again), overwrite=True)
    return target


def dated(dataset: Dataset) -> Dataset:
    """The dataset as a file contains it: times count from the date of the first, if that is known."""
    about = dict(dataset[TIME].attrs)
    unit, start = _SPELLED.get(str(about["units"])), about.pop("start", "")
    if not (start and unit):
        return dataset
    return dataset.assign_coords(
        {TIME: (TIME, dataset[TIME].values, about | {"units": f"{unit} since {start}"})}
    )


def draw(series: Series) -> Figure:
    """Draw what varies against time with its errors, the fits of the times alone, and the rates."""
    data, time = series.dataset, series.times
    decided, of_spectra = is_decided(data["status"].values), SHOWN in data.coords
    cut = np.searchsorted(time, series.breaks)  # no line crosses a break
    panels = []
    for name in [str(n) for n in data.data_vars if data[n].dims and f"{n}_stderr_noise" in data]:
        value, error = (data[key].values for key in (name, f"{name}_stderr"))
        label = labelled(name.replace("_", " "), str(data[name].attrs["units"]).removesuffix("1"))
        at, middle, width = (np.insert(x, cut, np.nan) for x in (time, value, 1.96 * error))
        lines = [Line(at, middle, "all times together", "fit")]
        if name in series.map.dataset and of_spectra:
            alone = np.where(decided, np.asarray(series.map[name], float), np.nan)
            other = np.where(decided, np.nan, value)
            lines = [Line(time, alone, "each time alone", "data", "point"), *lines]
            lines += [Line(time, other, "not decided", "blue", "cross")] if np.isfinite(other).any() else []
        band = Band(at, middle - width, middle + width, "95 %", "fit")
        tall = 2.4 if name.endswith("thickness") else 1.6
        panels.append(Panel(label, lines, [band], tall, legend="" if panels else "above"))
    chi = np.asarray(data["chi2_reduced"].values, float)
    if np.any(np.abs(chi[np.isfinite(chi)] - 1) > 1e-6):  # else the noise is that of the residuals
        panels.append(Panel("reduced χ²", [Line(time, chi, "", "data", "point")], height=1.2))
    panels += [] if of_spectra else _light(series)
    if of_spectra:
        panels.append(
            Panel("rms of residuals", [Line(time, np.asarray(data.residual_rms), "", "data", "point")])
        )
        left = Raster(np.asarray(data[SHOWN]), np.asarray(data[WAVELENGTH]), np.asarray(data.residual).T)
        told = f"data − fit: blue −{left.limit:.2g}, red {left.limit:.2g}"
        panels.append(Panel("wavelength (nm)", height=1.8, title=told, raster=left))
    sections = [Section(labelled("time", _unit(series)), [[panel] for panel in panels])]
    if WORST in data.coords:
        sections.append(Section("wavelength (nm)", [_worst(series)]))
    return matplotlib_figure.draw(sections, f"{Path(series.map.input).name}\n{_sentence(series)}")


def _light(series: Series) -> list[Panel]:
    """The light of a trace with its fit, and what that leaves."""
    data, lines, left = series.dataset, [], []
    for i, nm in enumerate(np.asarray(data[WAVELENGTH])):
        colour = ("data", "blue", "green", "fourth")[i % 4]
        seen, rest = np.asarray(data.light[:, i]), np.asarray(data.residual[:, i])
        lines += [
            Line(series.times, seen, f"{nm:g} nm", colour, "point"),
            Line(series.times, seen - rest, "" if i else "fit", "fit"),
        ]
        left.append(Line(series.times, rest, "", colour, "point"))
    return [Panel("light", lines, height=1.8, legend="above"), Panel("data − fit", left, height=1.2)]


def _worst(series: Series) -> list[Panel]:
    """The spectra of the largest residuals with the fit of all times together."""
    data, nm, panels = series.dataset, np.asarray(series.dataset[WAVELENGTH]), []
    for i, at in enumerate(np.asarray(data[WORST])):
        rms = float(data.residual_rms[np.searchsorted(series.times, at)])
        lines = [
            Line(nm, np.asarray(data.worst_data[i]), "data", "data", "point"),
            Line(nm, np.asarray(data.worst_fit[i]), "fit", "fit"),
        ]
        panels.append(
            Panel(
                "",
                lines,
                title=f"{'' if i else 'worst: '}{at:.5g} {_unit(series)}, rms {rms:.2g}",
                height=1.6,
            )
        )
    return panels


def _unit(series: Series) -> str:
    return str(series.dataset[TIME].attrs.get("units", ""))


def _sentence(series: Series) -> str:
    """Number of times of each status, in words."""
    counts = ", ".join(f"{count} {word}" for word, count in series.status.items())
    return f"{len(series.times)} times: {counts}."


def _file_rows(series: Series) -> list[tuple[str, str]]:
    first, last = series.times[[0, -1]]
    rows = [("file", series.map.input), ("times", f"{first:.6g} to {last:.6g} {_unit(series)}")]
    return [*rows, *(("read" if i == 0 else "", note) for i, note in enumerate(series.map.notes))]


def _value_rows(series: Series) -> list[tuple[str, str]]:
    """Range of what varies, and the value of what all times share."""
    data, rows = series.dataset, []
    for name in map(str, data.data_vars):
        if f"{name}_stderr" not in data:
            continue
        value, error = np.asarray(data[name].values, float), np.asarray(data[f"{name}_stderr"].values, float)
        unit = str(data[name].attrs["units"]).removesuffix("1")
        if not data[name].dims:
            known = f"{with_error(float(value), float(error))} {unit}".rstrip()
            rows.append((name, f"{known}, the same at all times"))
            continue
        known = np.flatnonzero(np.isfinite(value))
        first, last = known[[0, -1]]
        low, high = np.nanmin(value), np.nanmax(value)
        rows.append(
            (name, f"{value[first]:.5g} at first, {value[last]:.5g} at last, {low:.5g} to {high:.5g} {unit}")
        )
        noise = np.nanmedian(np.asarray(data[f"{name}_stderr_noise"].values, float)[known])
        rows.append(
            ("", f"standard error {np.nanmedian(error[known]):.2g} (median), of the noise {noise:.2g}")
        )
    return rows


def _status_rows(series: Series) -> list[tuple[str, str]]:
    return [(word, advice) for word, advice in ADVICE.items() if word in series.status]


def _table(series: Series) -> Table:
    """A row for each time."""
    data = series.dataset
    columns: dict[str, Any] = {f"time_{_unit(series)}": series.times}
    for name in map(str, data.data_vars):
        if name == "status":
            columns[name] = [STATUSES[code] for code in data[name].values]
        elif data[name].dims == (TIME,):
            unit = str(data[name].attrs.get("units", "1")).replace("/", "_per_").removesuffix("1")
            columns[f"{name}_{unit}" if unit else name] = np.asarray(data[name].values, float)
        elif data[name].dims == (TIME, WAVELENGTH):
            nm = np.asarray(data[WAVELENGTH])
            columns |= {f"{name}_{x:g}_nm": column for x, column in zip(nm, data[name].values.T, strict=True)}
    return Table(columns)  # spreadsheets take the first line for the names of columns


def _page(series: Series, image: bytes, again: Sequence[tuple[str, str]]) -> str:
    return page(
        "map.html",
        f"Series of {Path(series.map.input).name}",
        [],
        kind="Series of spectra",
        tone="good" if series.decided >= 0.5 else "warn",
        sentence=" ".join(
            [_sentence(series), *(f"{text[0].upper()}{text[1:]}." for text in series.warnings)]
        ),
        pictures=[picture(image, _sentence(series))],
        errors=_ERRORS,
        parameters=PageTable("Parameters", (), _value_rows(series)),
        rates=PageTable("", (), []),
        statuses=PageTable("Statuses, and what to do", (), _status_rows(series)),
        plan=PageTable("Effects of the simulation", (), plan_rows(summarise(series.map))),
        file=PageTable("Files, and how they were read", (), _file_rows(series)),
        again=again,
    )
