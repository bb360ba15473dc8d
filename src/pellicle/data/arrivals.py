"""Files that arrive in a folder: each is taken once its writer has closed it.

The folder is polled, which also sees files that another machine writes. On Linux a lease on a file shows that
no process has it open for writing; elsewhere, and on network drives, a file is taken when its size and its
date have not changed for a while.

**Source:** fcntl(2), "Leases": a read lease is refused while the file is open for writing.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from math import inf
from pathlib import Path

from pellicle.errors import DataError

_SETTLED = 0.5
"""Seconds without a change after which a file is taken where no lease is to be had."""
_CLOCK = 0.1
"""Seconds for which the date of a folder may be that of an earlier change: the clock of a file system."""
_EVERY = 1.0
"""Seconds after which the folder is read again even where its date is the same."""
_LATEST = 32
"""Files that were taken last, of which a later change is noticed."""
_UNFINISHED = (".part", ".partial", ".tmp", ".temp", ".crdownload", ".filepart", "~")


class Arrivals:
    """Files of a folder that are finished, each once, and again where it is written again.

    **Arguments:** `folder`; `known`, sizes by name of files that were taken earlier; `besides`, files in the
    folder that are no data.

    **Raises:** DataError where the folder cannot be read.
    """

    def __init__(self, folder: Path, known: Mapping[str, int], besides: Iterable[Path] = ()):
        self.folder, self.sizes = folder, dict(known)
        self.besides = {path.resolve() for path in besides}
        self.waiting: dict[str, tuple[tuple[int, int], float]] = {}  # size and date, and when these were new
        self.taken: dict[str, tuple[int, int]] = {}
        self.dated, self.read_at = -1, -inf
        self._look()

    def finished(self) -> list[Path]:
        """Paths of files that are finished since the last call, the oldest first."""
        self._look()
        done = []
        for name in list(self.waiting):
            path, now = self.folder / name, time.monotonic()
            try:
                status = path.stat()
            except OSError:  # it was renamed or removed
                del self.waiting[name]
                continue
            seen = status.st_size, status.st_mtime_ns
            if self.waiting[name][0] != seen:
                self.waiting[name] = seen, now
            closed = is_closed(path)
            if status.st_size and (closed or (closed is None and now - self.waiting[name][1] >= _SETTLED)):
                done.append((seen[1], name))
                del self.waiting[name]
                self.sizes[name] = seen[0]
                self.taken.pop(name, None)
                self.taken[name] = seen
        while len(self.taken) > _LATEST:
            del self.taken[next(iter(self.taken))]
        return [self.folder / name for _, name in sorted(done)]

    def _look(self) -> None:
        """List names that are new, and files that were written again, if the folder may have changed."""
        try:
            dated, now = self.folder.stat().st_mtime_ns, time.monotonic()
            every = now - self.read_at >= _EVERY
            if dated == self.dated and not every and time.time_ns() - dated > 1e9 * _CLOCK:
                return
            names = os.listdir(self.folder)
        except OSError as error:
            raise DataError(f"{self.folder}: cannot be read ({error.strerror}); check the folder") from None
        first, self.dated = self.read_at == -inf, dated
        for name in names:
            if name in self.waiting or (name in self.sizes and not first):
                continue
            path = self.folder / name
            hidden = name.startswith((".", "~")) or name.lower().endswith(_UNFINISHED)
            if hidden or not path.is_file() or path.resolve() in self.besides:
                continue
            if path.stat().st_size != self.sizes.get(name, -1):
                self.waiting[name] = (-1, -1), now
        if every:
            self.read_at = now
            for name, seen in self.taken.items():
                with suppress(OSError):
                    status = (self.folder / name).stat()
                    if (status.st_size, status.st_mtime_ns) != seen:
                        self.waiting[name] = (-1, -1), now


def is_closed(path: Path) -> bool | None:
    """True where no process has a file open for writing, None where the system does not say."""
    try:
        import fcntl

        request, signal = fcntl.F_SETLEASE, fcntl.F_SETSIG
    except (ImportError, AttributeError):
        return None
    from signal import SIGURG

    try:
        file = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.fcntl(
            file, signal, SIGURG
        )  # who opens it meanwhile sends this, which is ignored; SIGIO ends us
        fcntl.fcntl(file, request, fcntl.F_RDLCK)
    except BlockingIOError:
        return False
    except OSError:  # of another owner, or on a network drive
        return None
    finally:
        os.close(file)
    return True
