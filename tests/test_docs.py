"""The documentation's commands and Python: they can be parsed, their files are there, and (slow) they run."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

from pellicle.cli import app, main

ROOT = Path(__file__).parents[1]
PAGES = {str(path.relative_to(ROOT / "docs")): path for path in sorted((ROOT / "docs").rglob("*.md"))}
FILE = re.compile(r"[\w./-]+\.(csv|txt|dat|toml)$")
#: Words of commands whose fits end in doubt (exit code 4), as their pages say.
DOUBTFUL = (
    "--recipe measurements/recipes/gold_on_glass_300nm.toml",
    "window.csv --layer TiO2 --substrate SiO2 --thickness",
    "oxide.csv --layer SiO2 --substrate Si --thickness 1000",
    "five_bands.toml",
)


def commands(page: str) -> list[list[str]]:
    """The words of each indented `pellicle ...` line, without `pellicle`."""
    lines = re.findall(r"^    pellicle (.*)$", PAGES[page].read_text("utf-8"), re.MULTILINE)
    return [shlex.split(line) for line in lines]


def python(page: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", PAGES[page].read_text("utf-8"), re.MULTILINE | re.DOTALL)


SHOWING = [page for page in PAGES if commands(page) or python(page)]


def test_pages_show_commands():
    assert {"tour.md", "howto/units.md", "explanation/effects.md"} <= set(SHOWING)


@pytest.mark.parametrize("page", SHOWING)
def test_commands_are_known_and_their_files_are_there(page):
    """In the repository, or written by a command before."""
    written = set()
    for words in commands(page):
        _, _, ignored = app.parse_args(words, exit_on_error=False, print_error=False)
        assert not ignored
        out = words[words.index("--out") + 1] if "--out" in words else None
        read = {word for word in words if FILE.match(word) and word != out}
        assert all(word in written or (ROOT / word).is_file() for word in read), words
        written.add(out)


@pytest.mark.slow  # some thirty fits; the test above sees every misspelt word and file
@pytest.mark.parametrize("page", SHOWING)
def test_they_run(page, tmp_path, monkeypatch, capsys):
    """In a folder of their own that has the repository's files."""
    for folder in ("docs", "fits", "measurements"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PELLICLE_CACHE", "off")
    for words in commands(page):
        monkeypatch.setattr(sys, "argv", ["pellicle", *words])
        expected = 4 if any(doubt in " ".join(words) for doubt in DOUBTFUL) else 0
        assert main() == expected, (words, capsys.readouterr())
    for block in python(page):
        exec(compile(block, page, "exec"), {})
