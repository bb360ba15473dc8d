"""Hard cases in pellicle and in other packages, against 50 digits: `python benchmarks/peers`.

Makes a virtual environment in .venv-peers (several GB: torch), installs each package by name, and
runs each in a process of its own, so that one that cannot be installed, crashes or hangs is an entry of
the table and not its end. Prints Markdown; with --write docs/hard_cases.md gets the same text.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from cases import CASES, WITHOUT_SLOPE
from packages import OURS, PEERS, Package
from table import table
from truth import truth

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
VENV = ROOT / ".venv-peers"
PAGE = ROOT / "docs" / "hard_cases.md"
SECONDS = 300  # for all the cases that a process has left
BEGIN, END = "<!-- peers: written by make peers -->", "<!-- /peers -->"


def peers_python() -> Path:
    """The Python of the packages' own environment, made if it is not there."""
    python = VENV / "bin" / "python"
    if not python.exists():
        made = subprocess.run([sys.executable, "-m", "venv", VENV], capture_output=True)
        if made.returncode:  # Debian splits venv's pip into a package of its own: then ours does
            subprocess.run([sys.executable, "-m", "venv", "--without-pip", VENV], check=True)
            pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "pip"]
            subprocess.run(pip, check=True)
    return python


def install(python: Path, package: Package) -> str | None:
    """None, or why pip could not."""
    command = [str(python), "-m", "pip", "install", "--quiet", *package.install]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode == 0:
        return None
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    return lines[-1].strip() if lines else f"pip ended with {done.returncode}"


def run(python: Path, package: Package) -> dict[str, Any]:
    """{case: answer}; a case that ends the process is "crash" or "hang", and the rest go on without it.

    Raises ImportError with the package's own words where it cannot even be imported.
    """
    answers: dict[str, Any] = {}
    while left := {name: case for name, case in CASES.items() if name not in answers}:
        lines, ended = work(python, package, left)
        if any("unusable" in line for line in lines):
            raise ImportError(lines[0]["unusable"])
        answers |= {line.pop("case"): line for line in lines}
        lost = next((name for name in left if name not in answers), None)
        if lost:
            answers[lost] = {"values": ended}
    return answers


def work(python: Path, package: Package, cases: dict[str, Any]) -> tuple[list[dict[str, Any]], str]:
    """What one process said before it ended, and the word for an end that comes too early."""
    command = [str(python), str(HERE / "worker.py"), package.adapter]
    environment = os.environ | {"CUDA_VISIBLE_DEVICES": "", "JAX_PLATFORMS": "cpu"}
    given = json.dumps(cases).encode()
    try:
        said = subprocess.run(command, input=given, capture_output=True, timeout=SECONDS, env=environment)
        out, ended = said.stdout, "crash"
    except subprocess.TimeoutExpired as late:
        out, ended = late.stdout or b"", "hang"
    return [json.loads(line) for line in out.decode().splitlines() if line.endswith("}")], ended


def version(python: Path, package: Package) -> str:
    """As the package's own metadata has it."""
    name = package.install[0] if package.install else "pellicle"
    code = f"import importlib.metadata as m; print(m.version({name!r}))"
    return subprocess.run([str(python), "-c", code], capture_output=True, text=True).stdout.strip()


def main(whole: bool, write: bool) -> None:
    truths = {name: truth(case, slopes=name not in WITHOUT_SLOPE) for name, case in CASES.items()}
    columns, notes = {}, []
    for package in (*OURS, *PEERS):
        python = peers_python() if package.install else Path(sys.executable)
        problem = install(python, package) if package.install else None
        try:
            if problem:
                raise ImportError(problem)
            columns[package.head] = run(python, package)
            notes.append(f"- {package.head} {version(python, package)}: {package.note}.")
        except ImportError as why:
            notes.append(f"- {package.head}: not installed: {why}")
        print(notes[-1], file=sys.stderr, flush=True)
        notes += refusals(columns.get(package.head, {}))
    text = report(columns, truths, notes, whole)
    print(text)
    if write:
        PAGE.write_text(inserted(PAGE.read_text(encoding="utf-8"), text), encoding="utf-8")


def refusals(answers: dict[str, Any]) -> list[str]:
    """A line for each distinct reason that a package gave for having no answer."""
    reasons: dict[str, list[str]] = {}
    for name, answer in answers.items():
        for kind in ("values", "slopes"):
            if isinstance(answer.get(kind), str) and len(answer[kind]) >= 12:
                reasons.setdefault(answer[kind][:120], []).append(name)
    return [f"  - refuses {', '.join(dict.fromkeys(names))}: {why}" for why, names in reasons.items()]


def report(columns: dict[str, Any], truths: dict[str, Any], notes: list[str], whole: bool) -> str:
    heads, answers = list(columns), list(columns.values())
    return "\n\n".join(
        [
            "Largest error of R and T, s and p:",
            table(heads, answers, truths, "values", whole),
            "Largest error of their derivatives in d, n, k, the substrate's n and the angle, "
            "as |g − g*|/(|g*| + 0.001):",
            table(heads, answers, truths, "slopes", whole),
            "Bold: not a number, refused, or off by more than 0.0005 (R, T) or 1 % (derivatives). "
            "†: the package warned.",
            "\n".join(notes),
        ]
    )


def inserted(page: str, text: str) -> str:
    """The page with `text` between its two markers."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise SystemExit(f"{PAGE.name} has no {BEGIN} … {END} to write between")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--all", action="store_true", help="every case, not only those with a failure")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/hard_cases.md too")
    given = parser.parse_args()
    main(given.all, given.write)
