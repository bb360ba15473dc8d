"""Ctrl-C and the end of a process, also where JAX would lose them."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import parent_process

_PAUSE = 0.05
"""Seconds after which a lost Ctrl-C is sent again."""


@contextmanager
def interruptible() -> Iterator[None]:
    """In this block SIGTERM raises KeyboardInterrupt as Ctrl-C does, and neither is lost in a callback."""
    hook, sys.unraisablehook = sys.unraisablehook, send_again
    in_main_thread = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if in_main_thread else None
    try:
        yield
    finally:
        sys.unraisablehook = hook
        if in_main_thread:
            signal.signal(signal.SIGTERM, before)


def send_again(raised: sys.UnraisableHookArgs) -> None:
    """Report an exception that Python ignores; send Ctrl-C again.

    JAX runs a callback in every garbage collection, and Python ignores what is raised in one.
    """
    if issubclass(raised.exc_type, KeyboardInterrupt):
        # not at once: it would be raised in this hook, and ignored
        timer = threading.Timer(_PAUSE, _interrupt_main_thread)
        timer.daemon = True
        timer.start()
    else:
        sys.__unraisablehook__(raised)


def _interrupt_main_thread() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:  # it wakes a thread that waits, too
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()


def end_with_parent() -> None:
    """End this process when the one that started it has ended, even by a signal that it cannot catch."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()
