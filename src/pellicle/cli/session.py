"""Setup of JAX, folders, exit codes, worker processes; Ctrl-C and SIGTERM, also where JAX would lose them."""

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
from math import inf
from multiprocessing import get_context, parent_process
from pathlib import Path
from shutil import disk_usage
from typing import Any, TypeVar
from warnings import filterwarnings

from pellicle.cli.messages import as_flags, say, show
from pellicle.errors import UsageError
from pellicle.programs.workers import single_threaded

GOOD, WRONG_USAGE, BAD_DATA, UNCLEAR, TOO_SHORT, OFF_SPEC, INTERRUPTED = 0, 2, 3, 4, 5, 6, 130
"""Exit codes: one answer, wrong flags, bad file or full disk, another status, chain too short, a limit of
--spec that is not met, Ctrl-C."""

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
    filterwarnings(
        "ignore", "Error reading persistent compilation cache"
    )  # damaged; compiled and written again
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


def error_message(error: Exception, paths: list[str]) -> str:
    """The message of an error with flags for arguments, and the data files in front unless it names one."""
    message = as_flags(str(error))
    return message if any(path in message for path in paths) else f"{', '.join(paths)}: {message}"


def reported(message: str, record: dict[str, Any] | None) -> int:
    """Print an error after which other files go on, and its JSON record if there is one; BAD_DATA."""
    say(f"pellicle: {message}")
    if record is not None:
        show(record)
    return BAD_DATA


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


def in_order(function: Callable[[Task], Result], tasks: Iterable[Task], workers: int) -> Iterator[Result]:
    """Compute `function` of each task in worker processes and yield the results in the order of the tasks.

    After Ctrl-C, or where a worker dies, no other task is begun, and the results that are finished are
    yielded before KeyboardInterrupt or BrokenExecutor is raised. `function`, tasks and results are pickled.
    """
    # spawned: a forked process would inherit the locks of JAX's threads in any state
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin)
    waiting: list[Future[Result]] = []
    try:
        # processes ignore Ctrl-C until they have a task, and use one thread each
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            with single_threaded():
                waiting = [pool.submit(_run, function, task) for task in tasks]
        finally:
            signal.signal(signal.SIGINT, handler)
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


def _begin() -> None:
    parent = parent_process()
    if parent is not None:  # end with it, even by a signal that it cannot catch
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()
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
