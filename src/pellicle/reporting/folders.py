"""Result folders: one for each fit, with report, JSON record, tables and figures."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.errors import UsageError
from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting.json_record import indented, to_json, versions, write_result
from pellicle.reporting.plain_text import csv_rows
from pellicle.reporting.repeats import FILES as REPEATS

if TYPE_CHECKING:
    from pellicle.fitting.repeated_measurements import Repeats
    from pellicle.fitting.result import Fit
    from pellicle.sampling.result import Posterior

INDEX_SCHEMA = "pellicle.fits/1"
CHAIN_SCHEMA = "pellicle.chain/1"
CHAIN = "chain.h5"
REPORT = "report.txt"
PAGE = "report.html"
SUMMARY = "summary.csv"
LIBRARY = "plotly.min.js"
SELF_CONTAINED = 20
"""Most fits of a batch whose pages contain Plotly; each copy takes 0.5 MB, and a thousand half a gigabyte."""
FINGERPRINT = "fingerprint"
"""Key of result.json that only a folder with all its files has."""
SCENE = "scene"
"""Key of result.json of what the scene was built from: a recipe, or flags."""


def write_fit(
    folder: str | os.PathLike[str],
    fit: Fit,
    posterior: Posterior | None = None,
    fingerprint: str = "",
    described: Mapping[str, Any] | None = None,
    recipe: Callable[[Path], str] | None = None,
    spec: Mapping[str, str] | None = None,
) -> Path:
    """Write a fit, and its posterior if there is one, into a folder.

    A fit has result.json, report.txt, report.html, fit.csv, figure.png and, of films, nk.csv, or one for each
    principal index of a birefringent layer; a posterior
    adds posterior.nc, corner.png and predictive.png. Each file appears complete or not at all; files of an
    earlier result are replaced. A `fingerprint` of what was fitted is added to result.json when all files are
    written. `described` is what the scene was built from, a recipe or flags. `recipe` gives the text of
    recipe.toml, a recipe in a folder that repeats the fit. `spec` are the verdicts on limits of parameters.

    **Returns:** the folder.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written;
    DataError for a full disk.
    """
    from pellicle.fitting.depth_profiles import fitted_profiles  # imports JAX
    from pellicle.reporting.figures import draw_fit
    from pellicle.reporting.fit_tables import fit_csv, nk_csvs, profile_csv
    from pellicle.reporting.fit_text import report
    from pellicle.reporting.page.fit_pages import fit_page
    from pellicle.reporting.page.repetition import repetition

    record = to_json(fit, posterior) | ({"spec": dict(spec)} if spec else {})
    if described is not None:
        record[SCENE] = dict(described)
    contents = {REPORT: report(fit, posterior), "fit.csv": fit_csv(fit)}
    contents |= nk_csvs(fit) if fit.layer_test is None else {}
    if profiles := fitted_profiles(fit):
        contents["profile.csv"] = profile_csv(fit, profiles)
    target = write_result(folder, record, contents | {"figure.png": draw_fit(fit)})
    _remove_tables_of_another_scene(target, contents)
    saved = None
    if recipe is not None:
        with suppress(UsageError):  # of a scene that no recipe can express
            write_text(target / "recipe.toml", recipe(target), overwrite=True)
            saved = target / "recipe.toml"
    pictures = {} if posterior is None else _write_posterior(target, posterior)
    image = (target / "figure.png").read_bytes()
    library = f"../{LIBRARY}" if (target.parent / LIBRARY).exists() else ""
    text = fit_page(fit, image, posterior, pictures, repetition(fit, described, recipe, saved), library)
    write_text(target / PAGE, text, overwrite=True)
    if fingerprint:
        write_text(target / MARKER, indented(record | {FINGERPRINT: fingerprint}), overwrite=True)
    return target


def _remove_tables_of_another_scene(target: Path, written: Iterable[str]) -> None:
    """Remove tables of an earlier fit that this one does not have, as of two indices; none of the user's."""
    for table in (target / "nk.csv", target / "profile.csv", *target.glob("nk_*.csv")):
        if table.name not in written and table.is_file():
            first = table.read_text(encoding="utf-8", errors="replace")[:40]
            if first.startswith(("# n and k of the fitted layer", "# profiles at ")):
                table.unlink()


def _write_posterior(target: Path, posterior: Posterior) -> dict[str, bytes]:
    """Write the draws and the figures of a posterior, and return the PNG images by name."""
    from pellicle.reporting.matplotlib_figure import save_figure
    from pellicle.reporting.posterior import corner_figure, write_netcdf
    from pellicle.reporting.predictive_figure import draw_predictions

    predictions = posterior.predictions()
    write_netcdf(target / "posterior.nc", posterior, predictions, overwrite=True)
    save_figure(corner_figure(posterior), target / "corner.png", overwrite=True, bbox_inches="tight")
    save_figure(draw_predictions(predictions), target / "predictive.png", overwrite=True)
    return {name: (target / f"{name}.png").read_bytes() for name in ("corner", "predictive")}


def chain_file(folder: str | os.PathLike[str]) -> Path:
    """Path of the chain in a result folder, which is made and marked as ours. Raises UsageError."""
    target = new_folder(folder)
    if not (target / MARKER).exists():
        begun = {"schema": CHAIN_SCHEMA, "status": "sampling", "versions": versions()}
        write_text(target / MARKER, indented(begun))
    return target / CHAIN


def folder_per_file(folder: str | os.PathLike[str], paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Folder of each file's fit: `folder` itself for one file, else sub-folders named by the files' stems.

    For several files `folder` is made, and its result.json lists the sub-folder of each file; for many it
    also has Plotly, which their pages share. Raises UsageError as `write_fit` does.
    """
    if len(paths) < 2:
        return [Path(folder) for _ in paths]
    root, names = new_folder(folder), distinct_stems(paths, {MARKER, PAGE, SUMMARY, *REPEATS})
    files = [{"path": os.fspath(path), "folder": name} for path, name in zip(paths, names, strict=True)]
    index = {"schema": INDEX_SCHEMA, "files": files, "versions": versions()}
    write_text(root / MARKER, indented(index), overwrite=True)
    if len(paths) > SELF_CONTAINED:
        from pellicle.reporting.page.document import plotly_script

        write_text(root / LIBRARY, plotly_script(), overwrite=True)
    return [root / name for name in names]


def distinct_stems(paths: Sequence[str | os.PathLike[str]], taken: Iterable[str] = ()) -> list[str]:
    """Name for each file: its stem, and -2, -3, ... where that is taken, in whatever case.

    A path may end with the name of one of the file's spectra in brackets, which is added to the stem.
    """
    taken, names = {name.casefold() for name in taken}, []
    for path in paths:
        file, _, spectrum = os.fspath(path).removesuffix("]").partition(" [")
        words = [Path(file).stem, *re.findall(r"[\w.+%-]+", spectrum)]
        stem = name = "-".join(word for word in words if word) or "spectrum"
        count = 1
        while name.casefold() in taken:
            count += 1
            name = f"{stem}-{count}"
        names.append(name)
        taken.add(name.casefold())
    return names


def write_summary(path: str | os.PathLike[str], records: Iterable[Mapping[str, Any]]) -> None:
    """Write one row for each file, spectrum or film: path and name within the file, status, verdict, free
    parameters with standard errors, that of the noise, the 95 % error and the unit, verdicts on limits, rms,
    reduced χ².

    The header is the first line, after a mark by which Excel recognises UTF-8.
    `records` are JSON records of fits and failures. An earlier summary in a folder that pellicle wrote is
    replaced. Raises UsageError in a folder with files that pellicle did not write.
    """
    rows = []
    for record in records:
        data = record["data"]
        row = {key: data[key] for key in ("path", "spectrum") if key in data}
        row |= {key: record[key] for key in ("status", "verdict")}
        for name, p in record["parameters"].items():
            if p["free"]:
                row |= {
                    name: p["value"],
                    f"{name}_stderr": p["stderr"],
                    f"{name}_stderr_noise": p["stderr_noise"],
                }
                row |= {f"{name}_95": p["expanded"], f"{name}_unit": p["unit"]}
        row |= {f"{name}_spec": found for name, found in record.get("spec", {}).items()}
        row |= {"rms": record["rms"], "chi2_reduced": record["chi2_reduced"]}
        rows.append(row | {"sha256": data["sha256"] or "", "error": record.get("error", "")})
    ends = ("rms", "chi2_reduced", "sha256", "error")
    union = dict.fromkeys(name for row in rows for name in row)  # in order of appearance
    header = [*(name for name in union if name not in ends), *ends]
    cells = [[row.get(name, "") for name in header] for row in rows]
    new_folder(Path(path).parent)
    write_text(path, "\ufeff" + csv_rows(header, cells), overwrite=True)


def write_index(
    folder: str | os.PathLike[str],
    records: Sequence[Mapping[str, Any]],
    folders: Sequence[str | os.PathLike[str] | None],
    repeats: Repeats | None = None,
) -> None:
    """Write the page of several fits into their folder, with links to each one's page in its own folder.

    `records` are JSON records of fits and failures, as many as there are `folders` or fewer; `repeats` is
    their scatter where they are repeated measurements. Raises as `write_summary` does.
    """
    from pellicle.reporting.page.batch_page import batch_page

    target, links = new_folder(folder), []
    for own in folders[: len(records)]:
        place = None if own is None else Path(own) / PAGE
        links.append(place.relative_to(target).as_posix() if place and place.exists() else None)
    write_text(target / PAGE, batch_page(records, links, repeats), overwrite=True)
