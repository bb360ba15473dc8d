"""Files that the user alone can write: code in them is run.

What is checked is what is open, so that nothing can be exchanged after the check. On Windows, where owners of
files cannot be checked in this way, no file is such a file.
"""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def read(path: Path) -> bytes | None:
    """Return the content of a file, None where it is absent or where others could have written it.

    File and folder must belong to the user, be writable by no one else, and be no symbolic links. What is
    checked is what is open, so that nothing can be exchanged after the check.
    """
    if not hasattr(os, "geteuid"):  # Windows
        return None
    try:
        with _opened(path.parent, os.O_DIRECTORY) as folder, _opened(path.name, 0, folder) as file:
            if not (_is_private(folder) and _is_private(file)):
                return None
            with open(file, "rb", closefd=False) as content:
                return content.read()
    except OSError:
        return None


def write(path: Path, content: bytes, limit: int) -> None:
    """Write a file, complete or not at all, into a folder of `make_folder`.

    The oldest files of the folder are removed until it holds at most `limit` bytes. Raises OSError.
    """
    handle, name = tempfile.mkstemp(dir=path.parent)  # readable and writable by the user alone
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(name, path)
    except OSError:
        with suppress(OSError):
            os.unlink(name)
        raise
    files = [(file, file.stat()) for file in path.parent.iterdir()]
    excess = sum(status.st_size for _, status in files) - limit
    for file, status in sorted(files, key=lambda each: each[1].st_mtime_ns):
        if excess <= 0:
            break
        with suppress(OSError):  # another process may have removed it
            file.unlink()
        excess -= status.st_size


def make_folder(path: Path) -> bool:
    """Make a folder for the user alone, if it is absent, and return whether no one else can write it.

    False too where it cannot be made, is a symbolic link, or the system has no owners of files (Windows).
    """
    if not hasattr(os, "geteuid"):
        return False
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=0o700, exist_ok=True)
        with _opened(path, os.O_DIRECTORY) as folder:
            return _is_private(folder)
    except OSError:
        return False


def others_can_write(path: Path) -> bool:
    """True where a file or folder belongs to another user, or another user can write it."""
    if not hasattr(os, "geteuid"):
        return False
    status = path.stat()
    return status.st_uid != os.geteuid() or bool(status.st_mode & _OTHERS_WRITE)


@contextmanager
def _opened(path: str | Path, kind: int, folder: int | None = None) -> Iterator[int]:
    # O_NONBLOCK: a pipe in the place of the file must not stop the process
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | kind, dir_fd=folder)
    try:
        yield handle
    finally:
        os.close(handle)


def _is_private(handle: int) -> bool:
    status = os.fstat(handle)
    return status.st_uid == os.geteuid() and not status.st_mode & _OTHERS_WRITE
