"""Setup of JAX and messages on stderr, whose Python arguments become flags, shared by the commands.

The library names arguments in backticks, as a Python caller writes them: `` `scale="slow"` ``. The
command line prints the flag: `--scale slow`. Other text in backticks is not changed.
"""

from __future__ import annotations

import ast
import os
import re
import shlex
import sys
from contextlib import suppress
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path
from shutil import disk_usage
from typing import TYPE_CHECKING
from warnings import filterwarnings

from pellicle.cli.flags import Flags
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit


_OTHER_NAMES = {"folder": "--out", "path": "--out", "space": "--signal"}
"""Flags of arguments that have another name."""
_COMMAND_ARGUMENTS = (
    *("depth", "invert", "joint", "no_browser", "numbers", "port", "posterior", "recipe", "repeats"),
    *("strip", "thickness_map", "to", "view"),
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


CACHE_VARIABLE = "PELLICLE_CACHE"
"""A folder for compiled programs, or `off`."""
ROOM = 2**22
"""Bytes that the compiled programs of a command need at most, roughly."""


def start(keep: bool = True) -> None:
    """Set JAX to float64 and, with `keep`, to keep compiled programs between runs.

    The cache is in the user's cache folder; the variable PELLICLE_CACHE names another folder, or is `off`.
    Compiled programs run with the user's rights, so there is no cache in a folder that others can write, nor
    without a folder that can be made.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    folder = cache_folder() if keep else None
    if folder is None:
        return
    from pellicle.programs.cache import others_can_write

    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return
    if others_can_write(folder):
        say(
            f"{folder}: others can write to this folder, so no compiled programs are kept in it: take"
            f" the right from them, or choose another folder with {CACHE_VARIABLE}"
        )
        return
    if disk_usage(folder).free < ROOM:
        say(f"{folder}: the disk is full, so new compiled programs are not kept and each run is slower")
        filterwarnings("ignore", "Error writing persistent compilation cache")  # of JAX, one for each program
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def cache_folder() -> Path | None:
    """The folder of compiled programs, None where they are not kept."""
    chosen = os.environ.get(CACHE_VARIABLE, "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return Path(chosen).expanduser()
    if sys.platform == "darwin":
        return Path("~/Library/Caches/pellicle").expanduser()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", "~")).expanduser() / "pellicle" / "cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "pellicle"


def not_negative(flag: str, number: float) -> None:
    """Raise UsageError where the number of a flag is negative or not finite."""
    if not 0 <= number < inf:
        raise UsageError(f"{flag} must not be negative, got {number:g}")


def check_folder(path: str) -> None:
    """Raise UsageError, before any work is done, for a folder that pellicle did not write."""
    if Path(path).exists():
        from pellicle.files import new_folder

        new_folder(path)


def say(*sentences: str) -> None:
    """Print to stderr; arguments in backticks become flags. A closed pipe is no error."""
    for sentence in sentences:
        with suppress(BrokenPipeError):
            print(as_flags(sentence), file=sys.stderr)


def show(text: str, files_follow: bool, end: str = "\n") -> None:
    """Print a result to stdout.

    Where the pipe is closed, as by `| head`, this ends the command, unless files are still to be written.
    """
    try:
        print(text, end=end, flush=True)
    except BrokenPipeError:
        if not files_follow:
            raise
        abandon_stdout()


def abandon_stdout() -> None:
    """Discard what stdout cannot take, which Python would try to write once more when it ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
