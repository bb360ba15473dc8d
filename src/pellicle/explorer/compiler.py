"""Programs compiled in the background, one at a time, the most urgent first."""

import atexit
import threading
from collections.abc import Callable, Hashable
from itertools import count
from queue import PriorityQueue
from typing import Any

NOW, SOON = 0, 1
"""Order of compilation: what a view waits for, and what the next view may need."""


def _nothing() -> None:
    """Mark the end of the queue."""


class Compiler:
    """Results of slow functions by key, each computed once by a background thread."""

    def __init__(self) -> None:
        self._found: dict[Hashable, Any] = {}
        self._asked: dict[Hashable, int] = {}
        self._queue: PriorityQueue[tuple[int, int, Hashable, Callable[[], Any]]] = PriorityQueue()
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
        self._queue.put((-1, next(self._numbers), None, _nothing))
        self._thread.join()

    def _work(self) -> None:
        while True:
            _, _, key, make = self._queue.get()
            if make is _nothing:
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
