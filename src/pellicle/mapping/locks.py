"""Locks of the places that maps and watched series are written to, for one process at a time."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pellicle.errors import UsageError


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the place of a store for this process, until the block or the process ends.

    The lock is on a hidden file beside it, which stays the same where a run replaces the store.

    **Raises:** UsageError where another run holds it.
    """
    lock = path.resolve().with_name(f".{path.resolve().name}.lock")
    handle = _locked(lock, path)
    try:
        yield
    finally:
        if handle is not None:
            _release(handle, lock)


def _locked(lock: Path, path: Path) -> int | None:
    """An open and locked file; None where the file system has no locks, or none can be written."""
    while True:
        try:
            lock.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:  # reported by what writes the store
            return None
        try:
            _lock(handle)
            if os.path.samestat(os.fstat(handle), lock.stat()):
                return handle
        except BlockingIOError:
            os.close(handle)
            raise UsageError(
                f"{path}: another run is writing there; wait for it, or choose another `out`"
            ) from None
        except FileNotFoundError:  # removed by a run that has just ended
            pass
        except OSError:  # a file system without locks
            return handle
        os.close(handle)


def _lock(handle: int) -> None:
    """Lock an open file for this process. Raises BlockingIOError where another process has it."""
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        except PermissionError as error:
            raise BlockingIOError(*error.args) from None
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _release(handle: int, lock: Path) -> None:
    """Remove the file of a lock, and close it."""
    try:
        lock.unlink(missing_ok=True)
        os.close(handle)
    except PermissionError:  # Windows removes no open file
        os.close(handle)
        with suppress(PermissionError):  # of a run that has just taken it
            lock.unlink(missing_ok=True)
