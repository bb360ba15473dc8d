"""Files of the project agree: citation, CONTRIBUTING, metadata, the conda recipe and the workflows."""

import ast
import pkgutil
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml

from pellicle.data.formats import plug_ins

ROOT = Path(__file__).parents[1]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text("utf-8")


def test_the_citation_file_is_complete():
    """The file and each reference have what the Citation File Format 1.2.0 requires, and this version."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert cited["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= cited.keys()
    newest = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)[0]
    assert cited["version"] == newest
    sources = (ROOT / "docs" / "sources.md").read_text("utf-8")
    for reference in cited["references"]:
        assert {"type", "title", "authors", "year"} <= reference.keys(), reference
        assert not reference.get("doi", "10.1/x").startswith("http"), reference
        family = reference["authors"][0]["family-names"]
        assert reference.get("doi", family) in sources, reference["title"]


def test_the_paper_cites_what_its_bibliography_has():
    paper, known = (ROOT / "paper" / name for name in ("paper.md", "paper.bib"))
    text = paper.read_text("utf-8")
    listed = re.findall(r"^@\w+\{(\w+)", known.read_text("utf-8"), re.MULTILINE)
    assert set(re.findall(r"@(\w+)", text)) == set(listed)
    for figure in re.findall(r"\]\((\S+\.png)\)", text):
        assert (paper.parent / figure).exists(), figure


PAGES = [
    *(ROOT / x for x in ("README.md", "CONTRIBUTING.md", "fits/README.md")),
    *(ROOT / "docs").rglob("*.md"),
]
CODE = {
    path: path.read_text("utf-8")
    for x in ("src", "tests", "scripts", "benchmarks")
    for path in (ROOT / x).rglob("*.py")
}
WORDS = {word for text in CODE.values() for word in re.findall(r"\w+", text)}
WORDS |= {"properdocs", "validation"}  # of the site's settings
WORDS |= {"sigma_psi_ane", "sigma_delta_ane"}  # columns whose names are composed
WORDS |= set(re.findall(r"\w+", (ROOT / "docs/recipe.schema.json").read_text("utf-8")))  # composed keys


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_modules_and_identifiers_named_on_a_page_exist(page):
    """Files by their path in the repository or in the package, or by the end of it; `NAME` in `module.py` (or
    of, to, from it) stands in it, `pl.NAME` is public, and any other identifier is in some module."""
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    files = set(re.findall(r"`([\w./]+\.(?:py|toml)|\w+/[\w./]+\.md)`", text)) - {
        "NN_name.py",
        "pellicle_film.py",
    }
    kept = ["/" + path.relative_to(ROOT).as_posix() for path in (*ROOT.glob("*"), *ROOT.glob("[a-z]*/**/*"))]
    written = re.findall(r"--out (\S+)", page.read_text("utf-8"))
    assert not [x for x in files if x not in written and not any(path.endswith("/" + x) for path in kept)]
    for name, module in re.findall(r"`(\w+)(?:\([^`]*\))?` (?:in|of|to|from)\s+`([\w/]+\.py)`", text):
        texts = [code for path, code in CODE.items() if path.as_posix().endswith("/" + module)]
        assert any(re.search(rf"\b{name}\b", code) for code in texts), (name, module)
    for name in re.findall(r"`((?:pl|pellicle)(?:\.\w+)+)(?:\([^`]*\))?`", text):
        if name != plug_ins.GROUP:  # of entry points
            assert pkgutil.resolve_name(name.replace("pl.", "pellicle.", 1)) is not None
    if page.stem != "from_other_programs":
        assert set(re.findall(r"`([A-Za-z_]\w*)(?:\([^`]*\))?`", text)) <= WORDS


@pytest.mark.parametrize("path", sorted((ROOT / "notebooks").glob("*.py")), ids=lambda path: path.stem)
def test_what_a_notebook_imports_exists(path):
    """Notebooks are executed long after the quick tests; a name that has moved is found here."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pellicle"):
            found: dict[str, object] = {}
            exec(ast.unparse(node), found)
            assert found.keys() >= {name.asname or name.name for name in node.names}


def test_the_house_is_drawn_in_the_order_of_the_import_contract():
    """The diagram of CONTRIBUTING, whose indented lines are folders inside of others."""
    (diagram,) = re.findall(r"^```text\n(.*?)^```", CONTRIBUTING, re.MULTILINE | re.DOTALL)
    drawn = [re.split(r"\s{2,}", line)[0] for line in diagram.splitlines() if not line.startswith(" ")]
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert drawn == pyproject["tool"]["importlinter"]["contracts"][0]["layers"]


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
OF_DEVELOPERS = {"all", "browser", "dev", "docs", "notebooks"}
MAKEFILE = (ROOT / "Makefile").read_text("utf-8")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
OTHER_NAMES = {"matplotlib-base": "matplotlib", "python-flatbuffers": "flatbuffers"}
"""Names of conda-forge that differ from those of the package index."""


def names_and_bounds(requirements: list[str]) -> dict[str, str]:
    """Return the bound of each requirement by its name, without blanks."""
    split = [re.fullmatch(r"([\w-]+)\s*(.*)", requirement) for requirement in requirements]
    return {OTHER_NAMES.get(m[1], m[1]): m[2].replace(" ", "") for m in split if m}


def test_the_extra_all_has_every_extra_for_users():
    [requirement] = EXTRAS["all"]
    assert (
        set(requirement.removeprefix("pellicle[").removesuffix("]").split(","))
        == EXTRAS.keys() - OF_DEVELOPERS
    )


def test_the_conda_recipe_has_the_dependencies_of_the_project():
    recipe = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text("utf-8"))
    run = names_and_bounds(recipe["requirements"]["run"])
    assert run.pop("python") == PROJECT["requires-python"]
    assert run == names_and_bounds(PROJECT["dependencies"])
    build = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["build-system"]["requires"]
    assert names_and_bounds(build).items() <= names_and_bounds(recipe["requirements"]["host"]).items()
    assert recipe["build"]["python"]["entry_points"] == [f"pellicle = {PROJECT['scripts']['pellicle']}"]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_run_targets_and_scripts_that_exist(path):
    steps = [
        step for job in yaml.safe_load(path.read_text("utf-8"))["jobs"].values() for step in job["steps"]
    ]
    for command in (step["run"] for step in steps if "run" in step):
        program, *arguments = shlex.split(command)
        if program in ("python", "pellicle"):
            assert all(any(ROOT.glob(x)) for x in arguments if x.startswith(("tests/", "measurements/"))), (
                command
            )
            continue
        exists = (ROOT / program).is_file()
        assert exists or (program == "make" and re.search(rf"^{arguments[0]}:", MAKEFILE, re.MULTILINE)), (
            command
        )


def test_a_workflow_tests_windows_and_macos():
    """Commands from tests of paths, processes, locks and consoles run on both, and one with a pattern."""
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))["jobs"].values()
    [job] = [job for job in jobs if "matrix" in job.get("strategy", {})]
    assert job["strategy"]["matrix"]["system"] == ["windows-latest", "macos-latest"]
    commands = " ".join(step["run"] for step in job["steps"] if "run" in step)
    assert all(name in commands for name in ("tests/cli", "tests/mapping", "tests/explorer", '*.csv"'))


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml")), ids=lambda p: p.stem
)
def test_forms_of_issues_ask_for_the_output_of_doctor(path):
    fields = [field["attributes"] for field in yaml.safe_load(path.read_text("utf-8"))["body"]]
    assert any("`pellicle doctor`" in field.get("description", "") for field in fields)


def test_every_declared_python_is_installed_by_the_workflow_and_tried_by_make():
    declared = {line.rpartition(" ")[2] for line in PROJECT["classifiers"] if re.search(r"3\.\d+$", line)}
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    assert declared == set(re.findall(r"^ {12}(3\.\d+)$", workflow, re.MULTILINE))
    assert declared == set(
        re.findall(r"python(3\.\d+)", re.findall(r"^PYTHONS \?= (.*)$", MAKEFILE, re.MULTILINE)[0])
    )


@pytest.mark.parametrize(
    ("version", "citation", "changelog", "found"),
    [
        ("0.2.0", "version: 0.2.0\n", "## 0.2.0 (2026-11-23)\n", 0),
        ("0.2.0", "version: 0.1.0\n", "## 0.2.0 (2026-11-23)\n", 1),
        ("0.2.0", "version: 0.2.0\n", "## 0.2.0 (unreleased)\n", 1),
        ("0.2.0.dev7+g1234567", "version: 0.1.0\n", "## 0.1.0 (unreleased)\n", 0),
    ],
)
def test_a_release_is_compared_with_the_citation_and_the_changelog(
    load_script, version, citation, changelog, found
):
    script = load_script("scripts/check_distribution.py")
    assert len(script.release_differences(version, citation, changelog)) == found
