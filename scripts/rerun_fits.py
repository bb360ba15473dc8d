"""Repeat the fits of `fits/` and compare the results with the kept ones.

Run `python scripts/rerun_fits.py [STUDY...]` (default: all). The exit code is 1 if a status has
changed, a value has moved by more than a tenth of its kept error by noise alone, or an error has changed by
more than a tenth. `--keep` replaces the kept results; review the change and give the reason in the commit.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from pellicle.cli.fit import fit
from pellicle.cli.flags import BatchFlags
from pellicle.files import replacing, write_text
from pellicle.reporting.json_record import indented

FITS = Path(__file__).resolve().parents[1] / "fits"
KEPT = ("result.json", "report.txt", "figure.png")
VOLATILE = ("versions", "seconds")
"""Keys that differ between runs and are not kept."""
SHARE = 0.1
"""Allowed change of a value in kept errors by noise alone, and of the errors themselves: rounding differs
between machines and versions."""


def studies(folder: Path = FITS) -> list[Path]:
    """Return the folders with a recipe, of one data file each: films, and surfaces under `brdf`."""
    return sorted(recipe.parent for recipe in folder.glob("**/recipe.toml"))


def name_of(study: Path) -> str:
    """Return the name of a study: its folder below `fits/`."""
    return study.relative_to(FITS).as_posix()


def run(study: Path, out: Path) -> dict[str, Any]:
    """Return the result of `pellicle fit --recipe recipe.toml --out OUT`, run in the study's folder.

    Its paths are therefore those of the recipe. Raises ValueError with the last message of the command if
    there is no result.
    """
    stderr = StringIO()
    with chdir(study), redirect_stdout(StringIO()), redirect_stderr(stderr):
        code = fit(recipe="recipe.toml", results=BatchFlags(out=str(out)))
    if code not in (0, 4):
        raise ValueError(stderr.getvalue().strip().rpartition("\n")[2])
    return json.loads((out / "result.json").read_text(encoding="utf-8"))


def differences(kept: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield a description of every change: of the status, and of values and errors beyond SHARE."""
    if kept["status"] != new["status"]:
        yield f"status {new['status']}, was {kept['status']}"
    before, now = kept["parameters"], new["parameters"]
    for name in before | now:
        if name not in before or name not in now:
            yield f"{name} is {'new' if name in now else 'gone'}"
        elif (change := _change(before[name], now[name])) is not None:
            yield f"{name} {change}"


def _change(kept: Mapping[str, Any], new: Mapping[str, Any]) -> str | None:
    if kept["stderr"] is None or new["stderr"] is None:  # infinite: the value is not determined
        same = kept["stderr"] == new["stderr"]
        return None if same else f"has a standard error of {new['stderr']}, had {kept['stderr']}"
    if abs(new["value"] - kept["value"]) > SHARE * kept["stderr_noise"]:
        return f"{new['value']:.8g}, was {kept['value']:.8g} ± {kept['stderr_noise']:.2g} by noise alone"
    for name, words in (("stderr", "a standard error"), ("stderr_noise", "an error by noise alone")):
        if abs(new[name] - kept[name]) > SHARE * kept[name]:
            return f"has {words} of {new[name]:.2g}, had {kept[name]:.2g}"
    return None


def keep(out: Path, study: Path) -> None:
    """Copy the KEPT files from the folder of a fit into the study, without times and versions."""
    record = json.loads((out / "result.json").read_text(encoding="utf-8"))
    lasting = {name: value for name, value in record.items() if name not in VOLATILE}
    write_text(study / "result.json", indented(lasting), overwrite=True)
    lines = (out / "report.txt").read_text(encoding="utf-8").splitlines(keepends=True)
    report = "".join(line for line in lines if line.split()[:1] != ["seconds"])
    write_text(study / "report.txt", report, overwrite=True)
    with replacing(study / "figure.png", overwrite=True) as draft:
        shutil.copyfile(out / "figure.png", draft)


def rerun(study: Path, keeping: bool = False) -> list[str]:
    """Repeat one study, and return its changes."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        try:
            result = run(study, out)
        except ValueError as error:
            return [str(error)]
        kept = study / "result.json"
        changes = ["has no kept result"]
        if kept.exists():
            changes = list(differences(json.loads(kept.read_text(encoding="utf-8")), result))
        if keeping:
            keep(out, study)
    return changes


def main() -> int:
    """Return 0 if all results agree with the kept ones, or were kept."""
    known = {name_of(study): study for study in studies()}
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("study", nargs="*", help="folders of fits/ (all)")
    parser.add_argument("--keep", action="store_true", help="replace the kept results")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.study if name not in known]:
        parser.error(f"unknown study {', '.join(unknown)}; the studies are {', '.join(known)}")
    worst = 0
    for name in arguments.study or known:
        changes = rerun(known[name], arguments.keep)
        print(f"{name}: {'; '.join(changes) or 'unchanged'}", flush=True)
        worst = max(worst, bool(changes) and not arguments.keep)
    return worst


if __name__ == "__main__":
    sys.exit(main())
