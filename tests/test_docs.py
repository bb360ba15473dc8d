"""What the README and the documentation show to be typed can be typed: commands, Python, TOML.

Every command of pellicle that a page shows is run here, in the page's order. One of another program has a
line in `ELSEWHERE`, one that takes too long for every day a line in `SLOW`; each says why.
"""

from __future__ import annotations

import json
import re
import shlex
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest
import yaml

from pellicle.cli import app, main

ROOT = Path(__file__).parents[1]
_PATHS = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "fits/README.md", "measurements/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in _PATHS}
TYPED = re.compile(r"(?:\.venv/bin/)?(?:pellicle|make|python|pip|source) \S.*")
PLACE = re.compile(r"\.\.\.|\b[A-Z]{3,}\b")
FENCE = re.compile(r"^```([a-z]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"[\w./-]+\.(csv|txt|dat|toml)$")

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]

DOUBTFUL = (
    "pellicle fit --recipe measurements/recipes/gold_on_glass_300nm.toml",
    "pellicle fit window.csv --layer TiO2 --substrate SiO2 --thickness 10:500",
    "pellicle fit oxide.csv --layer SiO2 --substrate Si --thickness 1000:3000",
    "pellicle sample --recipe docs/examples/five_bands.toml --out results/five_bands",
)
"""Their fits end in doubt (exit code 4), as their pages say."""
SLOW = {
    **{
        f"pellicle chart docs/surfaces/{name}.toml --out {name}.png": "one sphere of eight is drawn every day"
        for name in (
            *("figure_2_coloured", "figure_2_clay", "figure_3_parallel", "figure_3_deviated"),
            *("figure_4", "figure_5_low", "figure_5_high"),
        )
    },
    "pellicle compare film.csv": "6 s to compile; tests/cli/test_compare_command.py compares others",
    "pellicle fit --recipe fits/cauchy_100nm/recipe.toml": "one of the studies of tests/test_fits.py",
    "pellicle cost docs/cost/soap_film.toml --out cost": "fits by many solvers: a minute or two",
    **{
        f"pellicle cost docs/{scene}.toml --datasets 0": "twenty compilations; tests/cli/test_cost_command.py"
        for scene in (
            *("cost/soap_film", "cost/cuo_on_aluminium"),
            *("examples/coated_window", "examples/microscope"),
        )
    },
    "pellicle cost docs/surfaces/tempered_steel.toml --out cost": "forty compilations, and half a minute",
    "pellicle fit steel.csv --recipe docs/surfaces/tempered_steel.toml": "10 s to compile; "
    "tests/cli/test_brdf_command.py fits another",
    "pellicle sample --recipe fits/brdf/tempered_steel/recipe.toml --out results/steel": "20 s to compile; "
    "tests/sampling samples another",
}
CI = ("make fit", "make test", "make notebooks", "make docs")
_REPEATED = "a study of hours, whose tables are kept; its parts are tested in their own modules"
ELSEWHERE = {
    **dict.fromkeys(CI, "CI itself: .ci/run"),
    "make fits": "tests/test_fits.py: one study every day, all of them slow",
    **dict.fromkeys(("make slow", "make coverage"), "these tests"),
    "make bench": "speed is shown, never tested",
    "make properties": "tests/properties: the same on a hundred scenes",
    "make peers": "several GB of other packages; tests/test_peers.py does without them",
    "make figures": "tests/reference has the numbers; the pictures are kept",
    "source .venv/bin/activate": "a shell's own; make fit makes the folder",
    "pellicle demo": "tests/cli/test_demo_command.py",
    "pellicle --install-completion": "would write to this user's shell: cyclopts' own",
    "python benchmarks/calibration.py": _REPEATED,
    "python benchmarks/posterior.py": _REPEATED,
    "python benchmarks/colour.py": _REPEATED,
    "python benchmarks/brdf_recovery.py": _REPEATED,
    "python -m pytest": "this is it",
    "python scripts/make_measurements.py": "tests/test_measurements.py: two of the files",
    "python scripts/index_materials.py": "tests/materials/test_catalogue.py: the kept index",
}


def commands(text: str) -> list[str]:
    """What can be typed: lines of indented blocks and of fences without a language, and code spans.

    A span of two words, `pellicle cost`, is a mention, and one with a place to fill in (`NAME`, `...`) a
    pattern.
    """
    fenced = "".join(inside for kind, inside in FENCE.findall(text) if kind in ("", "sh"))
    prose = FENCE.sub("", text)
    lines = [*re.findall(r"^    (\S.*)$", prose, re.MULTILINE), *fenced.splitlines()]
    spans = re.findall(r"`([^`\n]+)`", re.sub(r"^    .*$", "", prose, flags=re.MULTILINE))
    spans = [span for span in spans if not re.fullmatch(r"pellicle [a-z]+", span)]
    typed = [re.sub(r"\s+# .*", "", line).strip() for line in [*lines, *spans]]
    return list(dict.fromkeys(line for line in typed if TYPED.fullmatch(line) and not PLACE.search(line)))


def ours(page: str) -> list[str]:
    """The commands of pellicle that are run here."""
    return [c for c in commands(PAGES[page]) if c.startswith("pellicle ") and c not in ELSEWHERE]


def is_slow(command: str) -> bool:
    """Whether it begins as one of `SLOW`."""
    return command.startswith(tuple(SLOW))


SHOWING = [page for page in PAGES if ours(page)]


def blocks(page: str, language: str) -> list[str]:
    return [text for kind, text in FENCE.findall(PAGES[page]) if kind == language]


def run(command: str, monkeypatch, capsys) -> str:
    """What it printed."""
    monkeypatch.setattr(sys, "argv", shlex.split(command))
    capsys.readouterr()
    code, said = main(), capsys.readouterr()
    assert code == (4 if command in DOUBTFUL else 0), (command, said)
    return said.out


def results(text: str) -> list[tuple[float, float]]:
    """Every value ± error."""
    return [(float(a), float(b)) for a, b in re.findall(r"(\d[\d.]*\d) ± (\d[\d.]*\d)", text)]


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder that has what a clone has, and that may be written to."""
    for folder in ("docs", "fits", "measurements"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PELLICLE_CACHE", "off")


def test_what_is_typed_is_found():
    page = (
        "Type\n\n    pellicle fit a.csv  # first\n    make fit\n    no command\n\nor `pellicle plan b.toml`, "
        "not `pellicle plan` or `pellicle fit NAME`\n\n```\npip install x\n```\n```python\nmake = 1\n```\n"
    )
    assert commands(page) == ["pellicle fit a.csv", "make fit", "pip install x", "pellicle plan b.toml"]
    assert len(ours("README.md")) > 5
    assert {"docs/tour.md", "docs/howto/units.md", "docs/explanation/effects.md"} <= set(SHOWING)


def test_whatever_is_shown_is_run_by_a_test():
    shown = {command for text in PAGES.values() for command in commands(text)}
    others = {c for c in shown if not c.startswith("pellicle ") or c in ELSEWHERE}
    extras = PROJECT["optional-dependencies"].keys()
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    for command in others:
        program, what = command.split()[:2]
        if program == "pip":
            assert set(re.findall(r"'\.\[(\w+)\]'", command)) <= extras, command
            continue
        assert any(command.startswith(line) for line in ELSEWHERE), f"who runs {command}?"
        assert program != "make" or what in targets, command
        assert program != "python" or what == "-m" or (ROOT / what).is_file(), command
    typed_by_ci = (ROOT / ".ci" / "run").read_text("utf-8").splitlines()
    assert all(any(line.startswith(command) for line in typed_by_ci) for command in CI)
    stale = [line for line in (*ELSEWHERE, *SLOW, *DOUBTFUL) if not any(c.startswith(line) for c in shown)]
    assert not stale


@pytest.mark.parametrize("page", SHOWING)
def test_commands_are_known_and_their_files_are_there(page):
    """In the repository, or written by a command before."""
    written = set()
    for command in ours(page):
        words = [word for word in shlex.split(command)[1:] if word != "--verbose"]
        _, _, ignored = app.parse_args(words, exit_on_error=False, print_error=False)
        assert not ignored
        out = words[words.index("--out") + 1] if "--out" in words else None
        read = {word for word in words if FILE.match(word) and word != out}
        assert all(word in written or (ROOT / word).is_file() for word in read), command
        written.add(out)


@pytest.fixture(scope="module")
def done():
    """Commands that a page before has run, and what they printed."""
    return {}


@pytest.mark.parametrize("page", SHOWING)
@pytest.mark.usefixtures("clone")
def test_commands_run(page, done, monkeypatch, capsys):
    """A second page need not run a command again, unless it reads what that writes."""
    shown = ours(page)
    for i, command in enumerate(shown):
        out = command.partition("--out ")[2].partition(" ")[0]
        wanted = out and any(out in later.split() for later in shown[i + 1 :])
        if not is_slow(command) and (wanted or command not in done):
            done[command] = run(command, monkeypatch, capsys)


@pytest.mark.parametrize("page", [page for page in SHOWING if results(PAGES[page])])
def test_results_that_a_page_tells_are_what_came_out(page, done):
    """Of whichever page's command: a second one did not run it again."""
    if not done:
        pytest.skip("no command was run before")
    found = results("".join(done.values()))
    for value, error in results(PAGES[page]):
        assert any(abs(value - v) < 0.3 * error and abs(error - e) < 0.2 * error for v, e in found), (
            f"{value} ± {error}"
        )


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in SHOWING if any(map(is_slow, ours(page)))])
@pytest.mark.usefixtures("clone")
def test_slow_commands_run(page, monkeypatch, capsys):
    """With all of their page, as they may read what others write."""
    for command in ours(page):
        run(command, monkeypatch, capsys)


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")])
@pytest.mark.usefixtures("clone")
def test_python_runs(page):
    """The blocks of a page one after the other, as one would type them."""
    names: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(compile(block, page, "exec"), names)


def test_the_citation_is_whole_and_of_this_version():
    """What the Citation File Format 1.2.0 requires, of the file and of each reference."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert cited["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= cited.keys()
    assert cited["version"] == PROJECT["version"]
    for reference in cited["references"]:
        assert {"type", "title", "authors", "year"} <= reference.keys(), reference
        assert not reference.get("doi", "10.1/x").startswith("http"), reference
        family = reference["authors"][0]["family-names"]
        assert reference.get("doi", family) in PAGES["docs/sources.md"], reference["title"]


SCHEMA = json.loads((ROOT / "docs" / "recipe.schema.json").read_text("utf-8"))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "toml")])
def test_toml_is_toml_and_a_recipe_where_it_is_whole(page):
    for block in blocks(page, "toml"):
        found = tomllib.loads(block)
        if "data" in found and "scene" in found:
            jsonschema.validate(found, SCHEMA)


def test_every_flag_that_is_named_exists(monkeypatch, capsys):
    helps = []
    for command in ("", "fit", "sample", "simulate", "plan", "compare", "cost", "chart", "materials"):
        monkeypatch.setattr(sys, "argv", ["pellicle", *command.split(), "--help"])
        main()
        helps.append(capsys.readouterr().out)
    flag = re.compile(r"(?<![\w-])--[a-z][\w-]*")
    known = set(flag.findall(" ".join(helps)))
    for page, text in PAGES.items():
        for span in re.findall(r"`([^`\n]+)`", text):
            if not TYPED.fullmatch(span) or span.startswith("pellicle "):
                assert set(flag.findall(span)) <= known, (page, span)
