"""Translation of Python arguments in messages into the flags of the command line.

The library names arguments in backticks, as a Python caller writes them: `` `scale="slow"` ``. The
command line prints the flag: `--scale slow`. Other text in backticks is not changed.
"""

from __future__ import annotations

import ast
import re
import shlex
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from pellicle.cli.flags import Flags

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit

_OTHER_NAMES = {"folder": "--out", "path": "--out", "space": "--signal"}
"""Flags of arguments that have another name."""
_COMMAND_ARGUMENTS = (
    "depth",
    "invert",
    "joint",
    "no_browser",
    "numbers",
    "port",
    "posterior",
    "recipe",
    "repeats",
    "strip",
    "thickness_map",
    "to",
    "view",
)
"""Flags that one command has outside the groups of `pellicle.cli.flags`."""
_NEGATIVES = {"folded=False": "--no-folded", "resume=False": "--no-resume"}

_QUOTED = re.compile(r"`([^`]+)`")


@cache
def flag_names() -> dict[str, str]:
    """The flag of each argument that a message may name: that of a command, of the same name."""
    groups = [Flags]
    for group in groups:
        groups += group.__subclasses__()
    names = {name for group in groups for name in getattr(group, "__dataclass_fields__", ())}
    names.update(_COMMAND_ARGUMENTS)
    return {name: f"--{name.replace('_', '-')}" for name in names} | _OTHER_NAMES


def as_flags(text: str) -> str:
    """Replace arguments in backticks by flags.

    `` `thickness` `` becomes `--thickness`, `` `angle=70` `` `--angle 70`, `` `range=(400, 900)` `` and
    `` `thickness=Free(10, 3000)` `` bounds (`--range 400:900`), `` `columns=["wavelength", "R"]` `` a list
    (`--columns wavelength,R`), and `` `folded=True` `` a flag without a value.
    """
    return _QUOTED.sub(lambda quoted: _flags(quoted[1]) or quoted[0], text)


def _flags(code: str) -> str | None:
    """The flags of the arguments in `code`, None where one of them has no flag."""
    call = f"f({code})"
    try:
        parsed = ast.parse(call, mode="eval").body
    except SyntaxError:
        return None
    if not isinstance(parsed, ast.Call):
        return None
    words = []
    for name in parsed.args:
        if not isinstance(name, ast.Name) or name.id not in flag_names():
            return None
        words.append(flag_names()[name.id])
    for keyword in parsed.keywords:
        negative = _NEGATIVES.get(f"{keyword.arg}={ast.unparse(keyword.value)}")
        if negative:
            words.append(negative)
            continue
        value = _word(keyword.value, call)
        if keyword.arg not in flag_names() or value is None:
            return None
        words.append(f"{flag_names()[keyword.arg]} {value}".rstrip())
    return " ".join(words)


def _word(value: ast.expr, source: str) -> str | None:
    """A value as it is typed after its flag: empty for True, None where no flag says it."""
    match value:
        case ast.Constant(value=True):
            return ""
        case ast.Constant(value=False | None):
            return None
        case ast.Constant(value=str(text)):
            return shlex.quote(text)
        case ast.Tuple(elts=items) | ast.Call(func=ast.Name(id="Free"), args=items, keywords=[]):
            words = [_word(item, source) for item in items]
            return None if None in words else ":".join(map(str, words))
        case ast.List(elts=items):
            words = [_word(item, source) for item in items]
            return None if None in words else ",".join(map(str, words))
        case ast.Call():
            return None
    return ast.get_source_segment(source, value)


def with_flags(fit: Fit) -> Fit:
    """A copy of a fit whose verdict and warnings name flags."""
    return replace(fit, verdict=as_flags(fit.verdict), warnings=tuple(map(as_flags, fit.warnings)))
