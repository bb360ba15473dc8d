"""Notebooks and their scripts agree, contain no outputs, and are pages of the documentation."""

from pathlib import Path

import jupytext
import pytest

ROOT = Path(__file__).parents[1]
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
