"""Size and structure of the code: lines, modules, long functions, arrows between packages.

    python scripts/measure_structure.py           # a table
    python scripts/measure_structure.py --list    # and the places behind the counts

Lines of code are lines with a token, without blanks, comments and docstrings. A file knows a kind of signal
if it has the word of one or asks for what only one kind has, outside the package of signals.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parents[1]
SOURCE, TESTS = ROOT / "src" / "pellicle", ROOT / "tests"
LONGEST = 50
"""Lines of a function, its signature and docstring included."""
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
KIND = re.compile(
    r"""["'](psi-delta|(?<!'jones',\ ')mueller|generalised-psi-delta|contrast)["']
      # the word of a kind, not the public names "jones", "mueller"
      | \bELLIPSOMETRY\b
      # what only one kind has
      | \b(spectrum|data|first|sweep|view|part|s|one)\.(folded|elements|ratios|depolarisation)\b
      | \b(mueller|generalised|read_ellipsometry)\.SIGNAL\b
      | isinstance\([^)]*\b(Power|PsiDelta|Mueller|Generalised|Contrast)\b""",
    re.VERBOSE,
)
KINDS = ("signals/",)
"""Where the kinds of signal are defined."""
CONCLUDES = re.compile(
    r"(fitting|mapping)/.*\b(discrepancy|covariance|noise|profile_likelihood|profiles|neighbourhood|identifiability"
    r"|status|misfit|lack_of_fit|estimates|conclusion|errors|limits|nuisances|positive_definite)\w*\.py$"
)
"""Modules that turn minima into errors and a status."""


def lines_of_code(path: Path) -> int:
    """Count the lines of a file that bear code."""
    text = path.read_text("utf-8")
    documented = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, (ast.Module, *DEFINITIONS)) and ast.get_docstring(node, clean=False) is not None
        for line in range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)
    }
    empty = (
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    used = {line for t in tokens if t.type not in empty for line in range(t.start[0], t.end[0] + 1)}
    return len(used - documented)


def long_functions(tree: ast.Module) -> list[tuple[int, int, str]]:
    """Lines, place and name of the functions that are too long."""
    return [
        (node.end_lineno - node.lineno + 1, node.lineno, node.name)
        for node in ast.walk(tree)
        if isinstance(node, DEFINITIONS[:2])
        and node.end_lineno is not None
        and node.end_lineno - node.lineno + 1 > LONGEST
    ]


def private_definitions(tree: ast.Module) -> dict[str, int]:
    """How often the module uses each of its private functions, classes and methods."""
    defined = {node.name for node in ast.walk(tree) if isinstance(node, DEFINITIONS)}
    private = {name for name in defined if name.startswith("_") and not name.startswith("__")}
    used = Counter(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    used += Counter(node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute))
    return {name: used[name] for name in private}


def circles(trees: dict[str, ast.Module]) -> list[list[str]]:
    """Modules that import one another in a loop, at the head or within functions, but for type checkers."""
    names = list(trees)
    arrows = np.zeros((len(names),) * 2)
    for row, tree in enumerate(trees.values()):
        for node in _run(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                imported = {f"{node.module}.{alias.name}" for alias in node.names}
                if not imported <= trees.keys():
                    imported.add(node.module)
                arrows[row, [names.index(name) for name in imported & trees.keys() if name != names[row]]] = 1
    _, label = connected_components(arrows, connection="strong")
    return [[names[i] for i in np.flatnonzero(label == of)] for of in np.flatnonzero(np.bincount(label) > 1)]


def _run(node: ast.AST) -> Iterator[ast.AST]:
    """A node and all below it, without what only type checkers see."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)):
            yield from _run(child)


def main(listed: bool) -> None:
    """Print the table, and with `listed` the places."""
    paths = {path.relative_to(SOURCE).as_posix(): path for path in sorted(SOURCE.rglob("*.py"))}
    trees = {name: ast.parse(path.read_text("utf-8")) for name, path in paths.items()}
    size = {name: lines_of_code(path) for name, path in paths.items()}
    knows = [n for n, path in paths.items() if not n.startswith(KINDS) and KIND.search(_code(path))]
    concluding = [name for name in paths if CONCLUDES.search(name)]
    long = [(*row, name) for name, tree in trees.items() for row in long_functions(tree)]
    private = [count for tree in trees.values() for count in private_definitions(tree).values()]
    root = [name for name in paths if "/" not in name and name != "__init__.py"]
    modules = {_module(name): tree for name, tree in trees.items()}
    once = sum(count == 1 for count in private) / len(private)
    rows = {
        "lines of code in src": sum(size.values()),
        "lines of code in tests": sum(map(lines_of_code, TESTS.rglob("*.py"))),
        "modules in src": len(paths),
        "files that know a kind of signal": len(knows),
        "lines of code that conclude": sum(size[name] for name in concluding),
        f"functions over {LONGEST} lines": len(long),
        "circles of imports": len(circles(modules)),
        "modules at the root": len(root),
        "private definitions with one use": f"{once:.0%} of {len(private)}",
    }
    for name, value in rows.items():
        print(f"{name:36}{value:>12}")
    if listed:
        print("\nknow a kind:", *knows, sep="\n  ")
        print("conclude:", *(f"{size[name]:5} {name}" for name in concluding), sep="\n  ")
        print(
            "long:",
            *(f"{n:4} {path}:{line} {name}" for n, line, name, path in sorted(long)[::-1]),
            sep="\n  ",
        )
        print("circles:", *circles(modules), sep="\n  ")
        packages = Counter()
        for name, lines in size.items():
            packages[name.split("/")[0]] += lines
        count = Counter(name.split("/")[0] for name in paths)
        print("packages:", *(f"{v:6} {count[k]:4} {k}" for k, v in packages.most_common()), sep="\n  ")


def _module(name: str) -> str:
    return ".".join(["pellicle", *Path(name).with_suffix("").parts]).removesuffix(".__init__")


def _code(path: Path) -> str:
    """The text of a file without comments and docstrings."""
    return ast.unparse(_without_docstrings(ast.parse(path.read_text("utf-8"))))


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, *DEFINITIONS)) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Pass()
    return tree


if __name__ == "__main__":
    main("--list" in sys.argv[1:])
