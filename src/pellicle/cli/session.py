"""Setup of JAX and messages on stderr, shared by the commands."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from math import inf
from pathlib import Path
from shutil import disk_usage
from warnings import filterwarnings

from pellicle.cli.messages import as_flags
from pellicle.errors import UsageError

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
    from pellicle.programs.private_files import others_can_write

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
