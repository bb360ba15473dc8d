"""Tables of whole fits, in Markdown."""

from __future__ import annotations

from whole_fits.comparison import PELLICLE, SEARCH, Compared, Result

WITHOUT_SCAN, SIXTEEN = ("SciPy, random", "SciPy, evolution"), "SciPy, 16 minima"


def calls(some: list[Compared]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and lines of the table of pellicle's calls."""
    header = (
        *("pellicle", "numbers", "first call, s", "first call, filled cache, s", "then, ms"),
        "compiled, ms",
        *("wall, ms", "right", "target, ms", "met"),
    )
    return header, [_call(one) for one in some]


def _call(one: Compared) -> tuple[str, ...]:
    ours = one.results[0]
    return (
        one.case,
        str(one.rows),
        f"{one.compiles.processor:.2f}",
        f"{one.loads.processor:.2f}",
        _ms(one.early.processor),
        _ms(ours.time.processor),
        _ms(ours.time.wall),
        f"{ours.right}/{ours.files}",
        _ms(one.target),
        "yes" if ours.time.processor <= one.target and ours.succeeds else "no",
    )


def others(some: list[Compared]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and lines of the table of all programs."""
    names = [result.name for result in some[0].results]
    return ("processor time, ms", *names), [(one.case, *map(_cell, one.results)) for one in some]


def ratios(some: list[Compared]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and lines of the table of how many times longer the others take than `pl.fit` and its search.

    It has the fastest program that is right, the fastest without a scan, and the polish of sixteen minima.
    """
    columns = "best other", "best without a scan", "16 minima"
    header = ("time over that of", *(f"{ours}: {each}" for ours in (PELLICLE, SEARCH) for each in columns))
    return header, [(one.case, *_ratios(one, 0), *_ratios(one, 1)) for one in some]


def _ratios(one: Compared, which: int) -> list[str]:
    ours, rest = one.results[which], one.results[2:]
    times = {result.name: result.time.processor for result in rest if result.succeeds}
    plain = [time for name, time in times.items() if name in WITHOUT_SCAN]
    chosen = min(times.values(), default=None), min(plain, default=None), times.get(SIXTEEN)
    return [f"{time / ours.time.processor:.2g}" if time and ours.succeeds else "–" for time in chosen]


def _cell(result: Result) -> str:
    effort = f"{result.effort}, " if result.effort else ""
    text = f"{_ms(result.time.processor)} ({effort}{result.right}/{result.files})"
    return text if result.succeeds else f"~~{text}~~"


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.0f}" if seconds >= 0.01 else f"{seconds * 1e3:.1f}"
