"""Ctrl-C and SIGTERM end a command, wherever they arrive."""

import gc
import os
import signal
import sys
import time

import pytest

from pellicle.cli.session import interruptible


class _Callback:
    """Python ignores what is raised in `__del__`, as in JAX's callback of the garbage collector."""

    def __init__(self):
        self.itself = self

    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):  # the signal is handled here
            pass


def _interrupted_in_a_callback():
    _Callback()
    gc.collect()
    time.sleep(20)


def _terminated():
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(20)


def test_ctrl_c_in_a_callback_is_not_lost():
    before = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), interruptible():
        _interrupted_in_a_callback()
    assert sys.unraisablehook is before


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_sigterm_is_as_ctrl_c():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), interruptible():
        _terminated()
    assert signal.getsignal(signal.SIGTERM) == before
