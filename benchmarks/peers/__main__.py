"""Hard cases, dispersion models and graded films in pellicle and other packages: `python benchmarks/peers`.

Creates a virtual environment in .venv-peers (several GB: torch), installs each package by name, and
runs each in a separate process. A package that cannot be installed, crashes or hangs becomes an entry of
the table. Prints Markdown; `--write` also writes it to docs/hard_cases.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import birefringent
import dispersion
import graded
from cases import CASES, WITHOUT_SLOPE
from environment import ROOT, install, peers_python
from packages import OURS, PEERS, Package
from table import table
from truth import truth

HERE = Path(__file__).resolve().parent
PAGE = ROOT / "docs" / "hard_cases.md"
SECONDS = 300  # for all remaining cases of a process
BEGIN, END = "<!-- {}: written by make peers -->", "<!-- /{} -->"
GROUPS = "films", "birefringent", "dispersion", "graded"


def run(python: Path, package: Package, cases: dict[str, Any]) -> dict[str, Any]:
    """Return {case: answer}; a case that ends the process is a "crash" or "hang", and the rest run again.

    Raises ImportError with the package's message if it cannot be imported.
    """
    answers: dict[str, Any] = {}
    while remaining := {name: case for name, case in cases.items() if name not in answers}:
        lines, end = work(python, package, remaining)
        if any("unusable" in line for line in lines):
            raise ImportError(lines[0]["unusable"])
        answers |= {line.pop("case"): line for line in lines}
        failed = next((name for name in remaining if name not in answers), None)
        if failed:
            answers[failed] = {"values": end}
    return answers


def work(python: Path, package: Package, cases: dict[str, Any]) -> tuple[list[dict[str, Any]], str]:
    """Return the lines that one process printed, and the word for an early end."""
    command = [str(python), str(HERE / "worker.py"), package.adapter]
    environment = os.environ | {"CUDA_VISIBLE_DEVICES": "", "JAX_PLATFORMS": "cpu"}
    stdin = json.dumps(cases).encode()
    try:
        process = subprocess.run(command, input=stdin, capture_output=True, timeout=SECONDS, env=environment)
        out, end = process.stdout, "crash"
    except subprocess.TimeoutExpired as timeout:
        out, end = timeout.stdout or b"", "hang"
    return [json.loads(line) for line in out.decode().splitlines() if line.endswith("}")], end


def version(python: Path, package: Package) -> str:
    """Return the version in the package's metadata."""
    name = package.install[0] if package.install else "pellicle"
    code = f"import importlib.metadata as m; print(m.version({name!r}))"
    return subprocess.run([str(python), "-c", code], capture_output=True, text=True).stdout.strip()


class Group(NamedTuple):
    """Cases of one kind, the packages that compute them, and the headings of their tables."""

    packages: tuple[Package, ...]
    cases: dict[str, Any]
    truths: dict[str, Any]
    values: str
    slopes: str


def group(name: str) -> Group:
    """Return the films, the birefringent films or the dispersion models."""
    if name == "dispersion":
        return Group(
            dispersion.PACKAGES,
            *dispersion.cases_and_truths(),
            values="Largest error of ε₁ and ε₂:",
            slopes="",
        )
    if name == "birefringent":
        return Group(
            birefringent.PACKAGES,
            *birefringent.cases_and_truths(),
            values="Largest error of the elements of the Jones matrix:",
            slopes="Largest error of their derivatives in all 15 numbers, as |g − g*|/(|g*| + 0.001):",
        )
    return Group(
        (*OURS, *PEERS),
        CASES,
        {case: truth(at, slopes=case not in WITHOUT_SLOPE) for case, at in CASES.items()},
        values="Largest error of R and T, s and p:",
        slopes="Largest error of their derivatives in d, n, k, the substrate's n and the angle, "
        "as |g − g*|/(|g*| + 0.001):",
    )


def main(names: list[str], every_case: bool, write: bool) -> None:
    for name in names:
        text = compared_graded() if name == "graded" else compared(group(name), every_case)
        print(text)
        if write:
            PAGE.write_text(inserted(PAGE.read_text(encoding="utf-8"), text, name), encoding="utf-8")


def compared_graded() -> str:
    """Return the table of graded films."""
    pythons: dict[str, Path | str] = {}
    for package in graded.PACKAGES:
        python = peers_python()
        pythons[package.adapter] = install(python, package) or python
    return graded.compared(pythons)


def compared(given: Group, every_case: bool) -> str:
    columns, notes = {}, []
    for package in given.packages:
        python = peers_python() if package.install else Path(sys.executable)
        problem = install(python, package) if package.install else None
        try:
            if problem:
                raise ImportError(problem)
            own = {
                k: x
                for k, x in given.cases.items()
                if package.adapter in x.get("packages", [package.adapter])
            }
            columns[package.head] = run(python, package, own)
            notes.append(f"- {package.head} {version(python, package)}: {package.note}.")
        except ImportError as why:
            notes.append(f"- {package.head}: not installed: {why}")
        print(notes[-1], file=sys.stderr, flush=True)
        notes += refusals(columns.get(package.head, {}))
    return report(given, columns, notes, every_case)


def refusals(answers: dict[str, Any]) -> list[str]:
    """Return a line for each distinct reason for a missing answer."""
    reasons: dict[str, list[str]] = {}
    for name, answer in answers.items():
        for kind in ("values", "slopes"):
            if isinstance(answer.get(kind), str) and len(answer[kind]) >= 12:
                reasons.setdefault(answer[kind][:120], []).append(name)
    return [f"  - refuses {', '.join(dict.fromkeys(names))}: {why}" for why, names in reasons.items()]


def report(given: Group, columns: dict[str, Any], notes: list[str], every_case: bool) -> str:
    heads, answers = list(columns), list(columns.values())
    slopes = table(heads, answers, given.truths, "slopes", every_case) if given.slopes else ""
    return "\n\n".join(
        [
            given.values,
            table(heads, answers, given.truths, "values", every_case or not slopes),
            *([given.slopes, slopes] if slopes else []),
            "Bold: not a number, refused, or an error of more than 0.0005 (values) or 1 % (derivatives). "
            "†: the package warned.",
            "\n".join(notes),
        ]
    )


def inserted(page: str, text: str, name: str = "films") -> str:
    """Return the page with `text` between the two markers of a group."""
    begin, end = BEGIN.format(name), END.format(name)
    before, found, rest = page.partition(begin)
    _, last, after = rest.partition(end)
    if not found or not last:
        raise SystemExit(f"{PAGE.name} does not contain the markers {begin} and {end}")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--all", action="store_true", help="show every case, not only those with an error")
    parser.add_argument("--write", action="store_true", help="write the tables to docs/hard_cases.md too")
    parser.add_argument("--group", choices=GROUPS, help="only these cases; by default all")
    given = parser.parse_args()
    main([given.group] if given.group else list(GROUPS), given.all, given.write)
