"""Atomic writing of files and result folders that never overwrites a user's files.

A file that exists is refused. A folder with files is refused unless pellicle wrote it, which its
`result.json` shows; then files of pellicle's names are replaced one by one and others stay. A writer of
several files writes `result.json` first, so that an interrupted run can be repeated.

The name of a temporary file contains the machine and the process that write it. Those of processes that were
killed are removed when their file, or another one in their result folder, is written again.
"""

import errno
import os
import platform
import re
import shutil
import tempfile
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from pellicle.errors import DataError, UsageError

MARKER = "result.json"
_MARK = '"pellicle.'  # every result carries "schema": "pellicle.fit/1" or the like
_TEMPORARY = re.compile(r"\.(?P<stem>.+)\.(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-\w{8}(\.\w+)?")
_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Errors of a disk that is full, at its quota or broken: another name in the same folder does not help."""
_LONGEST = 86400.0
"""Seconds after which a temporary file is of a process that has ended, whatever its number says."""


@contextmanager
def replacing(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary file beside `path` and rename it to `path` at the end of the block.

    The temporary name keeps the suffix, which some writers depend on. If the block raises, no file is left.
    Raises UsageError if `path` is a folder, exists without `overwrite`, or cannot be written; DataError for a
    full disk.
    """
    target = Path(path)
    check_new(target, overwrite=overwrite)
    _remove_strays(target.parent, target.stem)
    prefix = f".{target.stem}.{_machine()}-{os.getpid()}-"
    try:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=target.suffix, dir=target.parent)
    except OSError as error:
        raise not_written(target, error) from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        mask = os.umask(0)  # there is no other way to read it
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp's 0600 would keep colleagues out
        check_new(target, overwrite=overwrite)
        os.replace(temporary, target)
    except OSError as error:
        raise not_written(target, error) from None
    finally:
        temporary.unlink(missing_ok=True)


def check_new(target: Path, *, overwrite: bool = False, name: str = "path") -> None:
    """Raise UsageError where a file is a folder, exists without `overwrite`, or has no folder to be in.

    For writers that take long before they write. `name` is the argument that has the path.
    """
    if target.is_dir():
        raise UsageError(f"{target}: is a folder, not a file; choose another `{name}`")
    if target.exists() and not overwrite:
        raise UsageError(f"{target}: exists and is not overwritten; choose another `{name}` or remove it")
    if not target.parent.is_dir():
        raise UsageError(
            f"{target}: cannot be written (there is no folder {target.parent}); make it, or choose another"
            f" `{name}`"
        )


def check_space(path: Path, size: int) -> None:
    """Raise OSError where the disk has no room for `size` bytes in a file, which stays empty.

    For writers that cannot take the error themselves.
    """
    with path.open("rb+") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)  # knows quotas and limits of file sizes, too
            file.truncate(0)
        elif shutil.disk_usage(path.parent).free < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> None:
    """Write `text` as UTF-8 to `path`, complete or not at all. Raises as `replacing` does."""
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def new_folder(path: str | os.PathLike[str]) -> Path:
    """Make the folder for a result if it is absent, and return it.

    Temporary files that killed processes left in it are removed. Raises UsageError if `path` is a file,
    cannot be made, or is a folder with files that pellicle did not write, DataError for a full disk. Inside
    it, write with `overwrite=True`.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, not a folder; choose another `folder`")
    if folder.is_dir():
        _remove_strays(folder)
    marker = folder / MARKER
    ours = marker.is_file() and _MARK in marker.read_text(encoding="utf-8", errors="replace")
    if folder.is_dir() and any(folder.iterdir()) and not ours:
        raise UsageError(
            f"{folder}: holds files that pellicle did not write; choose an empty or new `folder`"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if error.errno in _DISK:
            raise not_written(folder, error) from None
        raise UsageError(f"{folder}: cannot be made ({error.strerror}); choose another `folder`") from None
    return folder


def not_written(target: Path, error: OSError) -> DataError | UsageError:
    """The error of a file that cannot be written."""
    # h5py raises errors of the disk without a number
    reason = error.strerror or next(iter(str(error).splitlines()), type(error).__name__)
    if error.errno in _DISK or any(os.strerror(number) in reason for number in _DISK):
        return DataError(f"{target}: cannot be written ({reason}); make room on that disk")
    return UsageError(f"{target}: cannot be written ({reason}); choose another `path`")


def _remove_strays(folder: Path, stem: str | None = None) -> None:
    """Remove temporary files, of one `stem` or all, whose process has ended."""
    with suppress(OSError):  # a folder that cannot be read is reported where it is written
        for file in os.scandir(folder):
            match = _TEMPORARY.fullmatch(file.name)
            if match and stem in (None, match["stem"]):
                here, process = match["machine"] == _machine(), int(match["process"])
                if (here and _has_ended(process)) or file.stat().st_mtime < time.time() - _LONGEST:
                    os.unlink(file)


def _has_ended(process: int) -> bool:
    """True where no process of this number runs; False on Windows, where asking would end it."""
    if os.name == "nt":
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:  # it belongs to another user
        return False
    return False


@cache
def _machine() -> str:
    """Eight digits that stand for this machine's name: a folder may be shared over a network."""
    return f"{zlib.crc32(platform.node().encode()):08x}"
