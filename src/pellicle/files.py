"""Atomic writing of files and result folders that never overwrites a user's files.

A file that exists is refused. A folder with files is refused unless pellicle wrote it, which its
`result.json` shows; then files of pellicle's names are replaced one by one and others stay. A writer of
several files writes `result.json` first, so that an interrupted run can be repeated.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pellicle.errors import UsageError

MARKER = "result.json"
_MARK = '"pellicle.'  # every result carries "schema": "pellicle.fit/1" or the like


@contextmanager
def replacing(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary file beside `path` and rename it to `path` at the end of the block.

    The temporary name keeps the suffix, which some writers depend on. If the block raises, no file is left.
    Raises UsageError if `path` is a folder, exists without `overwrite`, or cannot be written.
    """
    target = Path(path)
    _refuse_existing(target, overwrite)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=target.suffix, dir=target.parent)
    except FileNotFoundError:
        raise UsageError(
            f"{target}: cannot be written (there is no folder {target.parent}); make it, or choose another"
            " `path`"
        ) from None
    except OSError as error:
        raise UsageError(f"{target}: cannot be written ({error.strerror}); choose another `path`") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o666 & ~_umask())  # mkstemp's 0600 would keep colleagues out
        _refuse_existing(target, overwrite)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> None:
    """Write `text` as UTF-8 to `path`, complete or not at all. Raises as `replacing` does."""
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def new_folder(path: str | os.PathLike[str]) -> Path:
    """Make the folder for a result if it is absent, and return it.

    Raises UsageError if `path` is a file, cannot be made, or is a folder with files that pellicle did not
    write. Inside it, write with `overwrite=True`.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, not a folder; choose another `folder`")
    if folder.is_dir() and any(folder.iterdir()) and not _is_ours(folder):
        raise UsageError(
            f"{folder}: holds files that pellicle did not write; choose an empty or new `folder`"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made ({error.strerror}); choose another `folder`") from None
    return folder


def _is_ours(folder: Path) -> bool:
    marker = folder / MARKER
    return marker.is_file() and _MARK in marker.read_text(encoding="utf-8", errors="replace")


def _refuse_existing(target: Path, overwrite: bool) -> None:
    if target.is_dir():
        raise UsageError(f"{target}: is a folder, not a file; choose another `path`")
    if target.exists() and not overwrite:
        raise UsageError(f"{target}: exists and is not overwritten; choose another `path` or remove it")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
