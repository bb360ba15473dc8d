"""The documentation site: its navigation, and the notebooks that become its pages."""

import json
from collections.abc import Iterator
from pathlib import Path

import jupytext
import nbformat
import numpy as np
import pytest
import yaml

import pellicle as pl

ROOT = Path(__file__).parents[1]
CONFIG = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))
FIGURE = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
"""A PNG of one pixel."""


def pages(entries: object) -> Iterator[str]:
    """Yield the paths of a navigation, in order."""
    if isinstance(entries, str):
        yield entries
    for entry in (
        entries if isinstance(entries, list) else entries.values() if isinstance(entries, dict) else ()
    ):
        yield from pages(entry)


def test_the_navigation_has_every_page_once():
    written = [path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")]
    tutorials = [f"tutorials/{path.stem}.md" for path in (ROOT / "notebooks").glob("*.ipynb")]
    assert sorted(pages(CONFIG["nav"])) == sorted([*written, *tutorials])


@pytest.fixture
def staged(load_script, tmp_path):
    """Return a function that stages a page and a notebook with these outputs, and returns the folder."""
    pytest.importorskip("nbconvert", reason="the extra docs is not installed")
    script = load_script("scripts/stage_docs.py")
    docs, executed, target = tmp_path / "docs", tmp_path / "executed", tmp_path / "build" / "docs"
    docs.mkdir()
    (docs / "index.md").write_text("Read the [tutorial](../notebooks/01_films.ipynb).\n", "utf-8")
    executed.mkdir()

    def stage(*outputs: nbformat.NotebookNode) -> Path:
        cells = [
            nbformat.v4.new_markdown_cell("# Films"),
            nbformat.v4.new_code_cell("plot()", outputs=list(outputs)),
        ]
        nbformat.write(nbformat.v4.new_notebook(cells=cells), executed / "01_films.ipynb")
        script.stage(docs, executed, target)
        return target

    return stage


def test_a_notebook_becomes_a_page_with_its_figures(staged):
    target = staged(nbformat.v4.new_output("display_data", {"image/png": FIGURE}))
    assert (target / "index.md").read_text("utf-8") == "Read the [tutorial](tutorials/01_films.md).\n"
    page = (target / "tutorials" / "01_films.md").read_text("utf-8")
    assert page.startswith("# Films")
    figure = page.partition("![figure drawn by the code above](")[2].partition(")")[0]
    assert (target / "tutorials" / figure).read_bytes().startswith(b"\x89PNG")


def test_a_notebook_that_wrote_to_stderr_is_refused(staged):
    with pytest.raises(SystemExit, match=r"01_films\.ipynb wrote to stderr: a warning"):
        staged(nbformat.v4.new_output("stream", name="stderr", text="a warning"))


@pytest.mark.slow
def test_the_demonstration_of_the_explorer_has_the_curves_of_its_sliders(load_script, tmp_path):
    script = load_script("scripts/explorer_demo.py")
    script.write_demo(tmp_path / "demo.html")
    page = (tmp_path / "demo.html").read_text("utf-8")
    demo = json.loads(page.partition("const demo = ")[2].partition(";\n")[0].replace("<\\/", "</"))
    assert [(each["name"], each["step"]) for each in demo["scene"]["controls"]] == [*script.STEPS.items()]
    assert len(demo["views"]) == 101 * 6
    curve = pl.reflectance(script.WAVELENGTHS, 420.0, "SiO2", "Si", angle=45.0)
    np.testing.assert_allclose(demo["views"]["42,3"]["y"], curve, atol=1e-4)
    assert all(sphere.startswith("data:image/png;base64,") for sphere in demo["spheres"])
    assert demo["plans"][0] != demo["plans"][3]


PAIRS = sorted((ROOT / "notebooks").glob("*.py"))


def sources(notebook):
    return [(cell.cell_type, cell.source) for cell in notebook.cells]


def test_every_notebook_has_a_script():
    assert PAIRS
    assert [path.stem for path in PAIRS] == [
        path.stem for path in sorted((ROOT / "notebooks").glob("*.ipynb"))
    ]


@pytest.mark.parametrize("path", PAIRS, ids=lambda path: path.stem)
def test_notebooks(path):
    """A notebook agrees with its script, contains no outputs and is a page of the documentation."""
    notebook, script = jupytext.read(path.with_suffix(".ipynb")), jupytext.read(path, fmt="py:percent")
    assert sources(notebook) == sources(script), "jupytext --sync notebooks/*.py"
    assert notebook.metadata.kernelspec.name == "python3"
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in code)
    assert f": tutorials/{path.stem}.md\n" in (ROOT / "mkdocs.yml").read_text("utf-8")
    title = script.cells[0]
    assert title.cell_type == "markdown"
    assert title.source.startswith("# ")
