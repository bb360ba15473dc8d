"""Commands, Python blocks and TOML blocks of the README and the documentation run.

Every `pellicle` command on a page is run here, in the page's order. Commands of other programs are listed in
`ELSEWHERE`, and commands that are too slow for every test run in `SLOW`, each with the reason, which is often
another test (of `tests/`).
"""

import json
import re
import shlex
import sys
import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import jsonschema
import pytest

from pellicle.cli import app, main
from pellicle.reporting import renderings

ROOT = Path(__file__).parents[1]
_PATHS = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "fits/README.md", "measurements/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in _PATHS}
COMMAND = re.compile(r"(?:\.venv/bin/)?(?:pellicle|make|python|pip|source) \S.*")
PLACEHOLDER = re.compile(r"\.\.\.|\b[A-Z]{3,}\b")
FENCE = re.compile(r"^```([a-z]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"[\w./-]+\.(csv|txt|dat|toml)$")

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def each(command: str, names: str) -> list[str]:
    """The command with each of these names."""
    return [command.format(name) for name in names.split()]


EXIT_4 = (
    "pellicle fit docs/examples/wedge.png --region 98,5,5,14 --layer SiO2 --substrate Si --thickness 10:800",
    "pellicle fit --recipe measurements/recipes/gold_on_glass_300nm.toml",
    "pellicle sample --recipe docs/examples/five_bands.toml --out results/five_bands",
    "pellicle fit film.csv --layer TiO2 --substrate Si",
    "pellicle identify film.csv --substrate Si",
)
"""These find no single answer (exit code 4), as their pages say."""
SLOW = (
    "pellicle identify unknown.csv",  # cli/test_identify.py
    "pellicle fit --recipe found/1.toml",  # identification/test_identify.py
    # compile for 4 to 30 s; what the test that is named covers
    "pellicle fit docs/examples/oxide_um_percent.csv --recipe docs/examples/oxide.rcp",  # recipes
    "pellicle fit film.csv --recipe docs/examples/two_layers.toml",  # fitting/film/test_search.py
    "pellicle fit film.csv --layer TiO2",
    "pellicle fit turned.csv --recipe docs/examples/tilted_azimuths.toml",  # fitting/film/test_generalised.py
    "pellicle simulate docs/examples/tilted_azimuths.toml --out turned.csv",  # forward_model
    "pellicle simulate docs/examples/mica.toml --out flake.csv --seed 1",  # signals/test_mica.py
    "pellicle fit flake.csv --recipe docs/examples/mica.toml",
    "pellicle simulate docs/examples/mica_flakes.toml",
    "pellicle simulate docs/examples/tilted_microscope.toml",  # forward_model/test_lens.py
    "pellicle fit oriented.csv --recipe docs/examples/tilted_microscope.toml",
    "pellicle fit soap_film.csv --recipe docs/examples/soap_film.toml",  # fitting/film/test_ties.py
    "pellicle simulate docs/examples/samples.toml",  # cli/test_simulate_command.py
    "pellicle fit --recipe docs/examples/samples.toml",  # fitting/film/test_samples.py
    "pellicle fit intensity.csv --layer",  # fitting/film/test_fit.py
    "pellicle fit partial.csv --recipe docs/examples/partial_window.toml",  # test_back_collected.py
    "pellicle simulate docs/examples/tilted_mueller.toml --out tilted.csv",  # test_anisotropic.py
    "pellicle fit film.csv --recipe docs/examples/mueller.toml",  # fitting/film/test_mueller.py
    "pellicle fit tilted.csv --recipe docs/examples/tilted_mueller.toml",  # hard/test_anisotropic.py
    "pellicle compare film.csv",  # cli/test_compare_command.py
    "pellicle plan docs/examples/graded.toml",  # effects/test_plan.py
    "pellicle plan-measurement docs/examples/nitride_film.toml",  # fitting/test_measurement_plan.py
    "pellicle fit graded.csv --recipe docs/examples/graded.toml --out results/graded",
    "pellicle compare graded.csv --recipe docs/examples/mixture.toml --recipe docs/examples/graded.toml",
    "pellicle fit steel.csv --recipe docs/surfaces/tempered_steel.toml",  # cli/test_brdf_command.py
    "pellicle fit full.csv --recipe docs/surfaces/figure_3_deviated.toml",
    "pellicle fit coat.csv --recipe docs/surfaces/clear_coat.toml",
    "pellicle fit published.csv --recipe docs/surfaces/shader_film_published.toml",
    "pellicle sample --recipe fits/brdf/tempered_steel/recipe.toml --out results/steel",  # sampling
    # draw more than one sphere of eight, and in full size
    *each("pellicle chart docs/surfaces/figure_{}.toml", "2_coloured 2_clay 3_parallel 3_deviated"),
    *each("pellicle chart docs/surfaces/figure_{}.toml", "4 5_low 5_high"),
    "pellicle chart docs/surfaces/shader_film.toml",
    "pellicle chart measurements/recipes/gold_on_glass_12nm.toml",
    "pellicle chart docs/cost/soap_film.toml --view",  # simulation/test_film_sphere.py: smaller ones
    "pellicle chart docs/surfaces/tempered_steel.toml --out results/steel.png",
    # compile twenty to forty programs, or fit with many solvers for minutes
    "pellicle cost docs/cost/soap_film.toml --out cost",
    *each("pellicle cost docs/{}.toml --datasets 0", "cost/soap_film cost/cuo_on_aluminium"),
    *each("pellicle cost docs/examples/{}.toml --datasets 0", "coated_window microscope graded"),
    "pellicle cost docs/examples/film_colours.toml",
    "pellicle cost docs/surfaces/tempered_steel.toml --out cost",
)
CI = ("make fit", "make test", "make notebooks", "make docs", "make dist")
ELSEWHERE = (
    *CI,  # .ci/run
    "make browser-tests",  # needs Chromium; reporting/test_page_in_browser.py, explorer
    "make dist-check",  # installs the wheel for every Python found; .ci/run: make dist
    "make fits",  # test_fits.py: all of them in make slow
    "pellicle fit --recipe fits/cauchy_100nm/recipe.toml",  # one of them
    *("make slow", "make coverage", "python -m pytest"),  # run these tests
    "make properties",  # properties: the same on thousands of scenes
    "make fuzz",  # data/test_properties.py: a short run
    "python benchmarks/identify",  # test_identify_benchmark.py: its simulator, cases and scores
    *("make verdicts", "python benchmarks/verdicts"),  # test_verdicts.py: its model, cases and scores
    # install several GB; test_benchmarks.py needs no other package
    *("make peers", "python benchmarks/peers/agreement.py --stacks 1000"),
    *each("python benchmarks/peers --group {} --write", "birefringent dispersion graded"),
    "python benchmarks/gpu.py",  # needs a GPU; test_benchmarks.py: its reference
    "make schema",  # recipes/test_schema.py: the kept schema
    "make figures",  # reference: the numbers; the figures are kept
    "source .venv/bin/activate",  # a shell builtin; make fit creates the folder
    "pellicle fit wafer.txt --layer cauchy --substrate Si",  # a file of the reader
    "pellicle demo",  # cli/test_demo_command.py
    # keep programs in the user's cache; cli/test_warm.py
    "pellicle warm --recipe measurements/recipes/hematite_on_glass_140nm.toml",
    "pellicle warm docs/examples/oxide_um_percent.csv --layer SiO2 --substrate Si --thickness 10:1000",
    # compiles for half a minute; fitting/film/test_index_curves.py, dispersion/test_spline.py
    'pellicle fit measurements/hematite_on_glass_140nm.csv --layer "spline-kk(400,470,540,610,690,780)"'
    " --substrate BK7 --thickness 10:1000 --out results/hematite_k",
    # serve a page until they are interrupted; explorer/test_server.py
    *("pellicle explore", "pellicle explore docs/examples/oxide.toml"),
    "pellicle explore --layer TiO2 --substrate BK7 --back air --signal T",
    "pellicle explore --signal psi-delta --angle 65,70,75",
    "pellicle --install-completion",  # would change the user's shell; part of cyclopts
    # speed is measured by benchmarks, never tested
    "make bench",
    *each("python benchmarks/{}.py", "fit film cold_start anisotropic explorer map"),
    # take hours; their tables are kept, and the modules that they use have their own tests
    *each("python benchmarks/{}.py", "calibration posterior colour brdf_errors brdf_recovery"),
    # take minutes, for which a test has a few films or pixels: reference, colour, mapping, rendering, brdf
    *each("python benchmarks/{}.py", "published colour_inverse colour_series map_regions renderers"),
    *each("python benchmarks/{}.py", "camera_colours brdf_bands mitsuba_films mitsuba_textures"),
    "python benchmarks/multiple_scattering.py",
    "python benchmarks/sample_coverage.py",  # fits 120 times; fitting/film/test_samples.py: errors by noise
    "python benchmarks/series.py",  # fits for minutes; mapping/test_series.py: a few films
    "python benchmarks/shared_index.py",  # fits for minutes; fitting/film/test_samples.py: two samples
    "python benchmarks/dispersion_models.py",  # fits for minutes; dispersion: the values of each model
    "python scripts/render_blade.py",  # rendering/test_mitsuba.py: its materials
    "python scripts/make_measurements.py",  # test_measurements.py
    "python scripts/index_materials.py",  # materials/test_catalogue.py: the kept index
)


def commands(text: str) -> list[str]:
    """Return the commands of a page: indented lines, lines of fences without a language, and code spans.

    A span of two words (`pellicle cost`) only mentions a command, and one with a placeholder (`NAME`, `...`)
    is a pattern: both are left out.
    """
    fenced = "".join(inside for kind, inside in FENCE.findall(text) if kind in ("", "sh"))
    prose = FENCE.sub("", text)
    lines = [*re.findall(r"^    (\S.*)$", prose, re.MULTILINE), *fenced.splitlines()]
    spans = re.findall(r"`([^`\n]+)`", re.sub(r"^    .*$", "", prose, flags=re.MULTILINE))
    spans = [span for span in spans if not re.fullmatch(r"pellicle [a-z][a-z-]*", span)]
    candidates = [re.sub(r"\s+# .*", "", line).strip() for line in [*lines, *spans]]
    found = [line for line in candidates if COMMAND.fullmatch(line) and not PLACEHOLDER.search(line)]
    return list(dict.fromkeys(found))


def pellicle_commands(page: str) -> list[str]:
    """Return the commands of a page that are run here."""
    return [c for c in commands(PAGES[page]) if c.startswith("pellicle ") and c not in ELSEWHERE]


def is_slow(command: str) -> bool:
    return command.startswith(SLOW)


PAGES_WITH_COMMANDS = [page for page in PAGES if pellicle_commands(page)]


def blocks(page: str, language: str) -> list[str]:
    return [text for kind, text in FENCE.findall(PAGES[page]) if kind == language]


def results(text: str) -> list[tuple[float, float]]:
    """Return every `value ± error` of a text."""
    return [(float(a), float(b)) for a, b in re.findall(r"(\d[\d.]*\d) ± (\d[\d.]*\d)", text)]


def missing_results(page: str, outputs: Iterable[str]) -> list[str]:
    """Return the results that a page quotes and no output contains, within a third of their error."""
    printed = [pair for text in outputs for pair in results(text)]
    return [
        f"{value} ± {error}"
        for value, error in results(PAGES[page])
        if not any(abs(value - v) < 0.3 * error and abs(error - e) < 0.2 * error for v, e in printed)
    ]


@pytest.fixture(scope="module")
def new_clone(tmp_path_factory):
    """Return a function that makes a writable folder with the contents of a clone."""

    def make():
        folder = tmp_path_factory.mktemp("clone")
        for name in ("docs", "fits", "measurements"):
            (folder / name).symlink_to(ROOT / name)
        return folder

    return make


@pytest.fixture(scope="module")
def clone_of(new_clone):
    """Return a function that finds the folder of a page's commands, with the files that they wrote."""
    return cache(lambda page: new_clone())


@pytest.fixture(scope="module")
def outputs():
    """What each command has printed so far in this module."""
    return {}


@pytest.fixture
def run_command(monkeypatch, capsys):
    """Return a function that runs one command, checks its exit code and returns its stdout.

    Spheres are drawn with 64 pixels across, not 260 or 420, and solvers fit one spectrum, not 20: most of the
    time otherwise.
    """
    for name in ("render", "ball", "bubble"):
        drawn = getattr(renderings, name)
        small = lambda *arguments, drawn=drawn: drawn(*arguments[:-1], 64)  # noqa: E731
        monkeypatch.setattr(renderings, name, small)

    def run(command):
        once = command.startswith("pellicle cost ") and "--datasets" not in command
        monkeypatch.setattr(sys, "argv", shlex.split(command) + ["--datasets", "1"] * once)
        capsys.readouterr()
        code, streams = main(), capsys.readouterr()
        assert code == (4 if command in EXIT_4 else 0), (command, streams)
        return streams.out

    return run


@pytest.fixture
def run_page(clone_of, run_command, outputs, monkeypatch):
    """Return a function that runs the commands of a page that have not run, or whose files it reads.

    The slow ones only where `slow`.
    """
    monkeypatch.setenv("PELLICLE_CACHE", "off")

    def run(page, slow=False):
        monkeypatch.chdir(clone_of(page))
        shown = pellicle_commands(page)
        for i, command in enumerate(shown):
            out = command.partition("--out ")[2].partition(" ")[0]
            is_missing = (
                out and not Path(out).exists() and any(out in later.split() for later in shown[i + 1 :])
            )
            if (slow or not is_slow(command)) and (is_missing or command not in outputs):
                outputs[command] = run_command(command)
            elif out:  # the folder of its result is there for the next commands
                Path(out).parent.mkdir(exist_ok=True)

    return run


def test_commands_of_a_page_are_found():
    page = (
        "Type\n\n    pellicle fit a.csv  # first\n    make fit\n    no command\n\nor `pellicle plan b.toml`, "
        "not `pellicle plan` or `pellicle fit NAME`\n\n```\npip install x\n```\n```python\nmake = 1\n```\n"
    )
    assert commands(page) == ["pellicle fit a.csv", "make fit", "pip install x", "pellicle plan b.toml"]
    assert len(pellicle_commands("README.md")) > 5
    assert {"docs/tour.md", "docs/howto/units.md", "docs/explanation/effects.md"} <= set(PAGES_WITH_COMMANDS)


def test_every_command_is_run_by_a_test():
    shown = {command for text in PAGES.values() for command in commands(text)}
    others = {c for c in shown if not c.startswith("pellicle ") or c in ELSEWHERE}
    extras = PROJECT["optional-dependencies"].keys()
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    for command in others:
        program, target = command.split()[:2]
        if program == "pip":
            named = re.findall(r"'(?:\.|pellicle)\[([\w,]+)\]'", command)
            assert {extra for names in named for extra in names.split(",")} <= extras, command
            continue
        assert any(command.startswith(line) for line in ELSEWHERE), f"no test runs {command}"
        assert program != "make" or target in targets, command
        assert program != "python" or target == "-m" or (ROOT / target).exists(), command
    ci = re.findall(r"^make (.*)", (ROOT / ".ci" / "run").read_text("utf-8"), re.MULTILINE)
    assert {command.split()[1] for command in CI} <= set(" ".join(ci).split())
    stale = [line for line in (*ELSEWHERE, *SLOW, *EXIT_4) if not any(c.startswith(line) for c in shown)]
    assert not stale


@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS)
def test_commands_parse_and_their_files_exist(page):
    """Files are in the repository, or written by an earlier command of the page."""
    written = set()
    for command in pellicle_commands(page):
        words = [word for word in shlex.split(command)[1:] if word != "--verbose"]
        _, _, ignored = app.parse_args(words, exit_on_error=False, print_error=False)
        assert not ignored
        out = {words[words.index(flag) + 1] for flag in ("--out", "--invert") if flag in words}
        read = {word for word in words if FILE.match(word) and word not in out}
        known = written | {word for word in read if Path(word).parent.as_posix() in written}
        assert all(word in known or (ROOT / word).is_file() for word in read), command
        written |= out


LONG_BLOCKS = (
    "docs/howto/absorption.md",
    "docs/howto/colours.md",
    "docs/howto/design_colour.md",
    "docs/howto/loops.md",
    "docs/howto/maps.md",
    "docs/howto/mueller.md",
    "docs/howto/posterior.md",
    "docs/howto/repeats.md",
    "docs/howto/samples.md",
    "docs/howto/series.md",
    "docs/howto/uncertainty.md",
    "docs/reference/colour.md",
)
"""Pages whose Python blocks compile for 2 to 12 s each: run in `make slow`."""


@pytest.mark.slow  # two minutes
@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS)
def test_commands_run(page, run_page):
    run_page(page)


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES_WITH_COMMANDS if results(PAGES[page])])
def test_quoted_results_are_printed(page, run_page, outputs):
    """By a command of the page, or of another one that shows the same command."""
    run_page(page, slow=True)
    for other in PAGES_WITH_COMMANDS:
        if not missing_results(page, outputs.values()):
            break
        run_page(other)
    assert not missing_results(page, outputs.values())


SLOW_PAGES = [page for page in PAGES_WITH_COMMANDS if any(map(is_slow, pellicle_commands(page)))]


@pytest.mark.slow
@pytest.mark.parametrize("page", SLOW_PAGES)
def test_slow_commands_run(page, run_page):
    run_page(page, slow=True)


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.slow) if page in LONG_BLOCKS else page
        for page in PAGES
        if blocks(page, "python")
    ],
)
def test_python_runs(page, new_clone, monkeypatch):
    """The blocks of a page run in order, in one namespace."""
    monkeypatch.setenv("PELLICLE_CACHE", "off")
    monkeypatch.chdir(new_clone())
    names: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(compile(block, page, "exec"), names)


@pytest.mark.parametrize("page", PAGES)
def test_linked_files_exist(page):
    """In the repository; `make docs` checks the links of the site."""
    text = FENCE.sub("", PAGES[page])
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        assert "://" in target or (ROOT / page).parent.joinpath(target).exists(), target


SCHEMA = json.loads((ROOT / "docs" / "recipe.schema.json").read_text("utf-8"))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "toml")])
def test_toml_parses_and_complete_recipes_are_valid(page):
    for block in blocks(page, "toml"):
        table = tomllib.loads(block)
        if "data" in table and "scene" in table:
            jsonschema.validate(table, SCHEMA)


def test_every_flag_on_a_page_exists(monkeypatch, capsys):
    names = "fit sample identify simulate plan plan-measurement compare cost chart explore export map series"
    names += " watch materials read doctor warm"
    helps = []
    for command in ("", *names.split()):
        monkeypatch.setattr(sys, "argv", ["pellicle", *command.split(), "--help"])
        main()
        helps.append(capsys.readouterr().out)
    flag = re.compile(r"(?<![\w-])--[a-z][\w-]*")
    known = set(flag.findall(" ".join(helps)))
    for page, text in PAGES.items():
        for span in re.findall(r"`([^`\n]+)`", text):
            if not COMMAND.fullmatch(span) or span.startswith("pellicle "):
                assert set(flag.findall(span)) <= known, (page, span)
