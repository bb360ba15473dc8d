"""Every command that the README shows works, if it needs no file of the reader's own."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

from pellicle.cli import main

ROOT = Path(__file__).parents[1]
FILE = re.compile(r"[\w./-]+\.(csv|txt|dat|toml)$")


def commands(text: str) -> list[list[str]]:
    """`pellicle ...` lines of code blocks, fenced or indented, without `$` and comments."""
    fenced = "".join(re.findall(r"^```[^\n]*\n(.*?)^```", text, re.DOTALL | re.MULTILINE))
    indented = re.findall(r"^    .*\n", text.replace("\\\n", " "), re.MULTILINE)
    found = []
    for line in [*fenced.replace("\\\n", " ").splitlines(), *indented]:
        words = shlex.split(line.strip().removeprefix("$ "), comments=True) if "pellicle " in line else []
        if words and words[0].rpartition("/")[2] == "pellicle":
            found.append(words[1:])
    return found


def ours(words: list[str]) -> bool:
    """Reads only files that the repository has."""
    read = [
        w for w, before in zip(words, ["", *words[:-1]], strict=True) if before != "--out" and FILE.match(w)
    ]
    return all((ROOT / word).exists() for word in read)


README = (ROOT / "README.md").read_text(encoding="utf-8")
SHOWN = commands(README)


def test_blocks_are_understood():
    fenced = "```sh\n$ pellicle fit a.csv \\\n   --layer SiO2  # a film\n.venv/bin/pellicle materials\n```\n"
    text = fenced + "Or\n\n    make fit\n    pellicle simulate b.toml\n"
    assert commands(text) == [["fit", "a.csv", "--layer", "SiO2"], ["materials"], ["simulate", "b.toml"]]
    assert commands("pellicle fit outside.csv") == []
    assert ours(["fit", "--out", "new.csv", "README.md"])
    assert not ours(["fit", "your-own.csv"])


def test_there_are_commands_once_the_readme_shows_a_fit():
    assert SHOWN or "pellicle fit" not in README


def test_every_flag_that_it_names_exists(monkeypatch, capsys):
    helps = []
    for command in ("", "fit", "sample", "simulate", "plan", "compare", "cost", "chart", "materials"):
        monkeypatch.setattr(sys, "argv", ["pellicle", *command.split(), "--help"])
        main()
        helps.append(capsys.readouterr().out)
    known = set(re.findall(r"--[a-z][\w-]*", " ".join(helps)))
    named = {flag for code in re.findall(r"`([^`]+)`", README) for flag in re.findall(r"--[a-z][\w-]*", code)}
    assert named <= known


# `pellicle demo` has its own test, in a folder of its own
@pytest.mark.parametrize("words", [w for w in SHOWN if ours(w) and w != ["demo"]], ids=" ".join)
def test_it_runs(words, monkeypatch, tmp_path, capsys):
    """Written results go elsewhere."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("PELLICLE_CACHE", "off")
    if "--out" in words:
        at = words.index("--out") + 1
        words = [*words[:at], str(tmp_path / Path(words[at]).name), *words[at + 1 :]]
    monkeypatch.setattr(sys, "argv", ["pellicle", *words])
    try:
        code = main()
    except SystemExit as left:
        code = left.code or 0
    assert code == (4 if "docs/examples/five_bands.toml" in words else 0), capsys.readouterr().err
