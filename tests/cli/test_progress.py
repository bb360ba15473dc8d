"""The line of progress on a terminal."""

import io
import logging
from types import SimpleNamespace

import jax
import pytest

from pellicle.cli import messages
from pellicle.cli.messages import COMPILING, PixelProgress, Progress, TimeLeft, duration


class _Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch, caplog):
    """stderr as a terminal of 200 columns, and the lines that it has shown."""
    screen = _Terminal()
    caplog.set_level(logging.WARNING, "pellicle")  # --verbose shows steps in place of the line
    monkeypatch.setattr(messages, "sys", SimpleNamespace(stderr=screen))
    monkeypatch.setenv("COLUMNS", "200")

    def lines():
        return [line.removesuffix("\033[K") for line in screen.getvalue().split("\r")[1:]]

    return lines


@pytest.fixture
def clock(monkeypatch):
    """The time in seconds, which a test sets."""
    now = [0.0]
    monkeypatch.setattr(messages.time, "monotonic", lambda: now[0])
    return now


def test_the_first_step_of_a_stage_is_no_measure_of_the_others(clock):
    left = TimeLeft()
    assert left("scan", 0, 10) == 0
    clock[0] = 60.0  # the first step compiles
    assert left("scan", 1, 10) == 0
    clock[0] = 62.0
    assert left("scan", 2, 10) == pytest.approx(16.0)
    clock[0] = 63.0
    assert left("polish", 5, 10) == 0  # another stage
    clock[0] = 64.0
    assert left("polish", 6, 10) == pytest.approx(4.0)
    assert left("polish", 2, 4) == 0  # the same stage begins again


def test_stage_steps_and_time_left(terminal, clock):
    with Progress("a.csv") as line:
        for clock[0], done in enumerate((0, 10, 20)):
            line("scan", done, 1000)
    assert terminal() == [
        "a.csv: scan 0/1000",
        "a.csv: scan 10/1000",
        "a.csv: scan 20/1000, 2 min left",  # 10 a second, 980 to go
        "",
    ]


def test_a_chain_may_end_before_its_last_step(terminal, clock):
    with Progress("a.csv") as line:
        for clock[0], done in enumerate((0, 100, 200)):
            line("sample", done, 20000)
        line("sample", 200, 200)
    shown = ["a.csv: sample 200 of at most 20000, at most 3 min left", "a.csv: sample 200/200", ""]
    assert terminal()[2:] == shown


def test_compiling_is_named(terminal):
    with Progress("a.csv") as line:
        line("scan", 0, 10)
        jax.jit(lambda x: x * 3.25 + 1.125).lower(2.0).compile()
        line("scan", 10, 10)
    jax.jit(lambda x: x * 4.25 + 1.125).lower(2.0).compile()  # nobody shows this one
    assert f"a.csv: scan 0/10, {COMPILING}" in terminal()
    assert terminal()[-2:] == ["a.csv: scan 10/10", ""]


def test_a_line_stays_a_line(terminal, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    with Progress("a long name of a file.csv") as line:
        line("scan", 1, 10)
    assert terminal()[0] == "a long name of a fi"


def test_nothing_is_shown_without_a_terminal(capsys):
    with Progress("a.csv") as line:
        line("scan", 1, 10)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("seconds", "words"), [(4.0, ""), (12.3, "12 s"), (180.0, "3 min"), (9e3, "2.5 h")])
def test_durations(seconds, words):
    assert duration(seconds) == words


def test_pixels_per_second_count_from_the_first_block(terminal, clock):
    with PixelProgress("wafer.nc") as line:
        line("pixels", 500, 100_500)  # of an earlier run
        line("starting workers", 0, 2)
        clock[0] = 60.0  # the first block compiles
        line("pixels", 1_500, 100_500)
        clock[0] = 62.0
        line("pixels", 11_500, 100_500)
        assert (line.done, line.total) == (11_500, 100_500)
    assert terminal() == [
        "wafer.nc: pixels 500/100500",
        "wafer.nc: starting workers, pixels 500/100500",
        "wafer.nc: pixels 1500/100500",
        "wafer.nc: pixels 11500/100500, 5e+03 pixels/s, 18 s left",
        "",
    ]
