"""Writing of colours as CSV."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pellicle.data.colours import Colours
from pellicle.files import write_text


def write_colours(
    path: str | os.PathLike[str], films: Sequence[Colours], *, comments: Sequence[str] = ()
) -> Path:
    """Write colours of one film or several, in one space, as `pellicle.read_colours` reads them.

    The first comment states the space. Sensor, gamma and camera are not in the file.

    **Raises:** ValueError for films of different spaces, UsageError where the file exists or cannot be
    written.
    """
    first = films[0]
    if any(film.space != first.space for film in films):
        raise ValueError("films of one file must be in one space")
    named = any(film.name for film in films)
    angled = any(film.angle is not None for film in films)
    spread = any(film.sigma is not None for film in films)
    header = ["name"] * named + ["angle_deg"] * angled + list(first.channels)
    header += [f"sigma_{channel}" for channel in first.channels] * spread
    rows = []
    for film in films:
        angle = np.zeros(len(film)) if film.angle is None else film.angle
        for at, values, sigma in zip(angle, film.values, film.noise, strict=True):
            numbers = [*[at] * angled, *values, *(sigma if spread else ())]
            rows.append(",".join([f'"{film.name}"'] * named + [f"{x:.8g}" for x in numbers]))
    light = "transmitted" if first.signal == "T" else "reflected"
    lines = [f"# signal {first.space}, {light}, {first.polarisation}", *(f"# {line}" for line in comments)]
    write_text(path, "\n".join([*lines, ",".join(header), *rows, ""]))
    return Path(path)
