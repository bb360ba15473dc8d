"""The citation file is complete, and CONTRIBUTING describes the folders and modules that there are."""

import re
import tomllib
from pathlib import Path

import yaml

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


def test_the_house_is_drawn_in_the_order_of_the_import_contract():
    """The diagram of CONTRIBUTING, whose indented lines are folders inside of others."""
    (diagram,) = re.findall(r"^```text\n(.*?)^```", CONTRIBUTING, re.MULTILINE | re.DOTALL)
    drawn = [re.split(r"\s{2,}", line)[0] for line in diagram.splitlines() if not line.startswith(" ")]
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert drawn == pyproject["tool"]["importlinter"]["contracts"][0]["layers"]


def test_modules_named_in_contributing_exist():
    """By their path in the repository or in the package, or by the end of it."""
    named = set(re.findall(r"`([\w./]+\.(?:py|toml|csv|md))`", CONTRIBUTING)) - {"NN_name.py"}
    paths = [*ROOT.glob("*"), *ROOT.glob("[a-z]*/**/*")]
    kept = ["/" + path.relative_to(ROOT).as_posix() for path in paths if path.is_file()]
    assert not [name for name in named if not any(path.endswith("/" + name) for path in kept)]


def test_identifiers_named_in_contributing_exist():
    """`NAME` in `module.py` (or of, to, from it) stands in it, any other identifier in some module."""
    code = {path: path.read_text("utf-8") for path in (ROOT / "src" / "pellicle").rglob("*.py")}
    words = {word for text in code.values() for word in re.findall(r"\w+", text)}
    words |= {
        word for path in (ROOT / "tests").rglob("*.py") for word in re.findall(r"\w+", path.read_text())
    }
    beside = re.findall(r"`(\w+)(?:\([^`]*\))?` (?:in|of|to|from)\s+`([\w/]+\.py)`", CONTRIBUTING)
    assert beside
    for name, module in beside:
        texts = [text for path, text in code.items() if path.as_posix().endswith("/" + module)]
        assert any(re.search(rf"\b{name}\b", text) for text in texts), (name, module)
    named = re.findall(r"`([A-Za-z_]\w*)(?:\([^`]*\))?`", CONTRIBUTING)
    assert {name for name in named if name not in words} <= {"properdocs", "validation"}
