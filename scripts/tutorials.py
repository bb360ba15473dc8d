"""MkDocs hook: turns each executed notebook into a page of the documentation, with its figures.

`make notebooks` executes the notebooks into executed/.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter
from nbformat import read

EXECUTED = Path(__file__).parents[1] / "executed"
LOG = logging.getLogger("mkdocs.plugins.tutorials")
NOTEBOOK_LINK = re.compile(r"\.\./notebooks/(\w+)\.ipynb")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add tutorials/NAME.md and its figures for each executed/NAME.ipynb."""
    for path in sorted(EXECUTED.glob("*.ipynb")):
        page, resources = MarkdownExporter().from_filename(str(path), {"output_files_dir": path.stem})
        page = page.replace("![png]", "![figure drawn by the code above]")
        contents = {f"{path.stem}.md": page, **resources["outputs"]}
        for name, content in contents.items():
            files.append(File.generated(config, f"tutorials/{name}", content=content))
        if text := stderr_of(path):
            LOG.warning("%s wrote to stderr: %s", path.name, text)
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace links to notebooks, which work in the repository, by links to their pages."""
    return NOTEBOOK_LINK.sub(r"tutorials/\1.md", markdown)


def stderr_of(path: Path) -> str:
    """Return what the cells of a notebook wrote to stderr, mostly warnings."""
    cells = (cell for cell in read(path, as_version=4).cells if cell.cell_type == "code")
    outputs = (output for cell in cells for output in cell.outputs)
    return "".join(output.text for output in outputs if output.get("name") == "stderr")
