"""Fit the studies of `fits/` again and compare with what they keep.

Run `python scripts/rerun_fits.py [STUDY...]` (default: all). It ends with 1 if a status is another
or a value has moved by more than a tenth of its kept standard error. With `--keep` the new results
take the place of the kept ones: a change to look at, and to give a reason for, in a commit.
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
from pellicle.files import replacing, write_text
from pellicle.reporting.json_record import indented

FITS = Path(__file__).resolve().parents[1] / "fits"
KEPT = ("result.json", "report.txt", "figure.png")
PASSING = ("versions", "seconds")
"""What differs from run to run, and is not kept."""
SHARE = 0.1
"""How far a value may move, in its kept standard errors: machines and versions of JAX round differently."""


def studies(folder: Path = FITS) -> list[Path]:
    """The folders that have a recipe, of one data file each: films, and surfaces under `brdf`."""
    return sorted(recipe.parent for recipe in folder.glob("**/recipe.toml"))


def called(study: Path) -> str:
    """What a study is called: its folder below `fits/`."""
    return study.relative_to(FITS).as_posix()


def run(study: Path, out: Path) -> dict[str, Any]:
    """The result of `pellicle fit --recipe recipe.toml --out OUT`, run in the study's own folder.

    So the paths in it are those of the recipe. Raises ValueError with what the command said, where
    there is no result.
    """
    talk = StringIO()
    with chdir(study), redirect_stdout(StringIO()), redirect_stderr(talk):
        code = fit(recipe="recipe.toml", out=str(out))
    if code not in (0, 4):
        raise ValueError(talk.getvalue().strip().rpartition("\n")[2])
    return json.loads((out / "result.json").read_text(encoding="utf-8"))


def moved(kept: Mapping[str, Any], found: Mapping[str, Any]) -> Iterator[str]:
    """A sentence for each thing that is not as it was: the status, and every value beyond SHARE."""
    if kept["status"] != found["status"]:
        yield f"status {found['status']}, was {kept['status']}"
    before, now = kept["parameters"], found["parameters"]
    for name in before | now:
        if name not in before or name not in now:
            yield f"{name} is {'new' if name in now else 'gone'}"
        elif (change := _change(before[name], now[name])) is not None:
            yield f"{name} {change}"


def _change(kept: Mapping[str, Any], found: Mapping[str, Any]) -> str | None:
    if kept["stderr"] is None or found["stderr"] is None:  # infinite: the value says nothing
        same = kept["stderr"] == found["stderr"]
        return None if same else f"has a standard error of {found['stderr']}, had {kept['stderr']}"
    if abs(found["value"] - kept["value"]) <= SHARE * kept["stderr"]:
        return None
    return f"{found['value']:.8g}, was {kept['value']:.8g} ± {kept['stderr']:.2g}"


def keep(out: Path, study: Path) -> None:
    """Copy what KEPT names from a fit's folder into the study, without times and versions."""
    record = json.loads((out / "result.json").read_text(encoding="utf-8"))
    lasting = {name: value for name, value in record.items() if name not in PASSING}
    write_text(study / "result.json", indented(lasting), overwrite=True)
    lines = (out / "report.txt").read_text(encoding="utf-8").splitlines(keepends=True)
    report = "".join(line for line in lines if line.split()[:1] != ["seconds"])
    write_text(study / "report.txt", report, overwrite=True)
    with replacing(study / "figure.png", overwrite=True) as draft:
        shutil.copyfile(out / "figure.png", draft)


def rerun(study: Path, keeping: bool = False) -> list[str]:
    """Fit one study; what has moved, in words."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        try:
            found = run(study, out)
        except ValueError as error:
            return [str(error)]
        kept = study / "result.json"
        changes = ["has no kept result"]
        if kept.exists():
            changes = list(moved(json.loads(kept.read_text(encoding="utf-8")), found))
        if keeping:
            keep(out, study)
    return changes


def main() -> int:
    """0 if all is as kept, or is kept now."""
    known = {called(study): study for study in studies()}
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("study", nargs="*", help="folders of fits/ (all)")
    parser.add_argument("--keep", action="store_true", help="write the new results into the studies")
    asked = parser.parse_args()
    if unknown := [name for name in asked.study if name not in known]:
        parser.error(f"no study {', '.join(unknown)}: there are {', '.join(known)}")
    worst = 0
    for name in asked.study or known:
        changes = rerun(known[name], asked.keep)
        print(f"{name}: {'; '.join(changes) or 'as kept'}", flush=True)
        worst = max(worst, bool(changes) and not asked.keep)
    return worst


if __name__ == "__main__":
    sys.exit(main())
