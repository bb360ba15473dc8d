"""Work in the background: programs compiled one at a time, the most urgent first, and one fit at a time."""

import atexit
import threading
from collections.abc import Callable, Hashable
from itertools import count
from queue import PriorityQueue
from typing import Any, TypeVar

from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress
from pellicle.fitting.result import Fit

Result = TypeVar("Result")
NOW, SOON = 0, 1
"""Order of compilation: what a view waits for, and what the next view may need."""


class Compiler:
    """Results of slow functions by key, each computed once by a background thread."""

    def __init__(self) -> None:
        self._found: dict[Hashable, Any] = {}
        self._asked: dict[Hashable, int] = {}
        self._queue: PriorityQueue[tuple[int, int, Hashable, Callable[[], Any] | None]] = PriorityQueue()
        self._numbers = count()
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, daemon=True, name="pellicle-compiler")
        self._thread.start()
        atexit.register(self.close)  # XLA aborts the process if it ends while a thread compiles

    def get(self, key: Hashable, make: Callable[[], Any], urgency: int = NOW) -> Any:
        """Return the result of `make` if it is there, else None and compute it in the background.

        Raises the ValueError that `make` has raised.
        """
        with self._changed:
            if key in self._found:
                program = self._found[key]
                if isinstance(program, ValueError):
                    raise program
                return program
            if self._asked.get(key, SOON + 1) > urgency:
                self._asked[key] = urgency
                self._queue.put((urgency, next(self._numbers), key, make))
            return None

    def wait(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return the result of `make` when it is there. Raises as `get` does."""
        self.get(key, make)
        with self._changed:
            self._changed.wait_for(lambda: key in self._found)
        return self.get(key, make)

    def close(self) -> None:
        """End the thread, after the program that it is compiling."""
        self._queue.put((-1, next(self._numbers), None, None))
        self._thread.join()

    def _work(self) -> None:
        while True:
            _, _, key, make = self._queue.get()
            if make is None:  # the end of the queue
                return
            if key in self._found:
                continue
            try:
                result = make()
            except ValueError as error:
                result = error
            except Exception as error:  # the thread must live on, and the page must say what is wrong
                result = ValueError(f"this combination cannot be computed: {error}")
            with self._changed:
                self._found[key] = result
                self._changed.notify_all()


class _Stopped(Exception):
    """A fit whose result is no longer wanted."""


class FitRun:
    """The fit that is running, and its progress."""

    def __init__(self) -> None:
        self._running, self._stop = threading.Lock(), threading.Event()
        self._progress = ("", 0, 0)

    def run(self, fit: Callable[[Progress], Fit]) -> Fit | None:
        """Return a fit that reports its progress; None where it was stopped. Raises UsageError while another
        fit runs."""
        return self.alone(lambda: fit(self._report))

    def alone(self, work: Callable[[], Result]) -> Result | None:
        """Return what `work` returns, None where it was stopped. Raises UsageError while a fit runs."""
        if not self._running.acquire(blocking=False):
            raise UsageError("a fit is running: stop it, or wait for its result")
        try:
            self._stop.clear()
            return work()
        except _Stopped:
            return None
        finally:
            self._progress = ("", 0, 0)
            self._running.release()

    def status(self) -> dict[str, Any]:
        """Return the stage of the fit in numbers and words."""
        stage, done, total = self._progress
        text = f"{stage} {done}/{total}" if total > 1 else stage
        return {"running": self._running.locked(), "stage": stage, "done": done, "total": total, "text": text}

    def stop(self) -> dict[str, Any]:
        """End the fit at its next step."""
        self._stop.set()
        return {"running": self._running.locked()}

    def _report(self, stage: str, done: int, total: int) -> None:
        self._progress = (stage, done, total)
        if self._stop.is_set():
            raise _Stopped
