"""What is released: the metadata, the conda recipe and the workflows agree with the project.

`make dist` checks the built files, `make dist-check` installs them.
"""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
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
        program, *arguments = command.split()
        exists = (ROOT / program).is_file()
        assert exists or (program == "make" and re.search(rf"^{arguments[0]}:", MAKEFILE, re.MULTILINE)), (
            command
        )


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
