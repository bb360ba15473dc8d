"""A hook of mkdocs: each executed notebook becomes a page of the documentation, with its figures.

`make notebooks` executes them, into executed/.
"""

from __future__ import annotations

import logging
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter
from nbformat import read

EXECUTED = Path(__file__).parents[1] / "executed"
LOG = logging.getLogger("mkdocs.plugins.tutorials")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The documentation's files, and tutorials/NAME.md with its figures for each executed/NAME.ipynb."""
    for path in sorted(EXECUTED.glob("*.ipynb")):
        page, resources = MarkdownExporter().from_filename(str(path), {"output_files_dir": path.stem})
        page = page.replace("![png]", "![what the code above draws]")
        content = {f"{path.stem}.md": page, **resources["outputs"]}
        for name, text_or_bytes in content.items():
            files.append(File.generated(config, f"tutorials/{name}", content=text_or_bytes))
        if talk := said_on_stderr(path):
            LOG.warning("%s wrote to stderr: %s", path.name, talk)
    return files


def said_on_stderr(path: Path) -> str:
    """What a notebook's cells wrote there: warnings, mostly."""
    cells = (cell for cell in read(path, as_version=4).cells if cell.cell_type == "code")
    outputs = (output for cell in cells for output in cell.outputs)
    return "".join(output.text for output in outputs if output.get("name") == "stderr")
