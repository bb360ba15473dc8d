"""Processes: worker processes for many files, Ctrl-C and SIGTERM, also where JAX would lose them."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, redirect_stderr
from io import StringIO
from multiprocessing import get_context, parent_process
from typing import TypeVar

from pellicle.cli.session import start
from pellicle.programs.threads import single_threaded

Task = TypeVar("Task")
Result = TypeVar("Result")

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


def in_order(function: Callable[[Task], Result], tasks: Iterable[Task], workers: int) -> Iterator[Result]:
    """Compute `function` of each task in worker processes and yield the results in the order of the tasks.

    After Ctrl-C, or where a worker dies, no other task is begun, and the results that are finished are
    yielded before KeyboardInterrupt or BrokenExecutor is raised. `function`, tasks and results are pickled.
    """
    # spawned: a forked process would inherit the locks of JAX's threads in any state
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin)
    waiting: list[Future[Result]] = []
    try:
        with _quiet_and_single_threaded():
            waiting = [pool.submit(_run, function, task) for task in tasks]
        while waiting:
            result = waiting[0].result()
            del waiting[0]
            yield result
    except (KeyboardInterrupt, BrokenExecutor):
        pool.shutdown(cancel_futures=True)
        yield from (x.result() for x in waiting if not x.cancelled() and x.exception() is None)
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _quiet_and_single_threaded() -> Iterator[None]:
    """Processes started in the block ignore Ctrl-C until they have a task, and use one thread each."""
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with single_threaded():
            yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _begin() -> None:
    end_with_parent()
    sys.unraisablehook = send_again
    with redirect_stderr(StringIO()):  # this process has printed what there is to say
        start()


def _run(function: Callable[[Task], Result], task: Task) -> Result:
    """The result of one task. After Ctrl-C this process begins no other: it keeps the signal's handler."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        raise KeyboardInterrupt
    signal.signal(signal.SIGINT, signal.default_int_handler)
    interrupted = False
    try:
        return function(task)
    except KeyboardInterrupt:  # the process that waits may have missed it: this exception goes there, too
        interrupted = True
        raise
    finally:
        if not interrupted:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
