"""Tables of whole fits, in Markdown."""

from __future__ import annotations

from whole_fits.comparison import Compared, Result


def calls(some: list[Compared]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and lines of the table of pellicle's calls."""
    header = (
        *("pellicle", "numbers", "first call, s", "first call, filled cache, s", "next calls, ms"),
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
        _ms(ours.time.processor),
        _ms(ours.time.wall),
        f"{ours.right}/{ours.files}",
        _ms(one.target),
        "yes" if ours.time.processor <= one.target and ours.succeeds else "no",
    )


def others(some: list[Compared]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and lines of the table of all programs, with the ratio of the best other program to pellicle."""
    names = [result.name for result in some[0].results]
    header = ("processor time, ms", *names, "best other / pellicle", "16 minima / pellicle")
    return header, [(one.case, *map(_cell, one.results), *_ratios(one)) for one in some]


def _cell(result: Result) -> str:
    effort = f"{result.effort}, " if result.effort else ""
    text = f"{_ms(result.time.processor)} ({effort}{result.right}/{result.files})"
    return text if result.succeeds else f"~~{text}~~"


def _ratios(one: Compared) -> tuple[str, str]:
    """How many times longer the fastest of the others takes, and the one that polishes as many minima."""
    ours, *rest = one.results
    times = {result.name: result.time.processor for result in rest if result.succeeds}
    chosen = min(times.values(), default=None), times.get("SciPy, 16 minima")
    ratios = [f"{time / ours.time.processor:.2g}" if time and ours.succeeds else "–" for time in chosen]
    return ratios[0], ratios[1]


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.0f}" if seconds >= 0.01 else f"{seconds * 1e3:.1f}"
