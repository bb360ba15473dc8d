"""Write the sources of the documentation site into build/docs, where `make docs` builds it.

They are the pages of docs/, under tutorials/ a page for each notebook of executed/, with its figures, and a
demonstration of the explorer. In docs/ links lead to notebooks, so that they work in the repository; in
build/docs they lead to tutorials.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from nbconvert import MarkdownExporter
from nbformat import read

ROOT = Path(__file__).resolve().parents[1]
STAGED = ROOT / "build" / "docs"
EXPLORER = "opens a page in your browser"
"""Words of howto/explore.md to which the link to the demonstration is added."""
NOTEBOOK_LINK = re.compile(r"\.\./notebooks/(\w+)\.ipynb")


def stage(docs: Path, executed: Path, target: Path) -> None:
    """Write pages and tutorials into an empty folder.

    **Raises:** SystemExit if a notebook wrote to stderr, mostly warnings.
    """
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(docs, target)
    for page in target.rglob("*.md"):
        page.write_text(NOTEBOOK_LINK.sub(r"tutorials/\1.md", page.read_text("utf-8")), "utf-8")
    for path in sorted(executed.glob("*.ipynb")):
        if text := stderr_of(path):
            raise SystemExit(f"{path.name} wrote to stderr: {text}")
        page, resources = MarkdownExporter().from_filename(str(path), {"output_files_dir": path.stem})
        tutorial = target / "tutorials" / f"{path.stem}.md"
        tutorial.parent.mkdir(exist_ok=True)
        tutorial.write_text(page.replace("![png]", "![figure drawn by the code above]"), "utf-8")
        for name, content in resources["outputs"].items():
            figure = tutorial.parent / name
            figure.parent.mkdir(exist_ok=True)
            figure.write_bytes(content)


def add_demo(target: Path) -> None:
    """Write the demonstration of the explorer into the staged folder, and link it from its page."""
    from explorer_demo import write_demo  # beside this script

    write_demo(target / "explorer_demo.html")
    page = target / "howto" / "explore.md"
    link = f"{EXPLORER} ([a demonstration](../explorer_demo.html) with stored answers)"
    page.write_text(page.read_text("utf-8").replace(EXPLORER, link, 1), "utf-8")


def stderr_of(path: Path) -> str:
    """Return what the cells of a notebook wrote to stderr."""
    cells = (cell for cell in read(path, as_version=4).cells if cell.cell_type == "code")
    outputs = (output for cell in cells for output in cell.outputs)
    return "".join(output.text for output in outputs if output.get("name") == "stderr")


if __name__ == "__main__":
    stage(ROOT / "docs", ROOT / "executed", STAGED)
    add_demo(STAGED)
