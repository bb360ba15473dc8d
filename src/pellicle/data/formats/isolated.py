"""Reading of binary files in a process of its own, for libraries that damaged files can crash.

HDF5 2.0 ends its process (segmentation fault) on some files with a few wrong bytes. The child gets the
content on its standard input and answers with a line of JSON and the columns as float64; it takes 0.25 s.
"""

import importlib
import json
import os
import subprocess
import sys

import numpy as np

from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError

TIMEOUT = 60.0
"""Seconds after which a reader is stopped; the largest accepted file takes about one."""

_CHILD = "from pellicle.data.formats.isolated import answer; answer()"


def call(reader: str, content: bytes) -> list[Table]:
    """Return `function(content)` for a reader "module:function" of numbers, called in a child process.

    Raises DataError as the reader does, and where it crashes or does not end.
    """
    command = [sys.executable, "-P", "-c", _CHILD, reader]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    damaged = "is a damaged file, on which its reader"
    try:
        done = subprocess.run(command, input=content, capture_output=True, timeout=TIMEOUT, env=environment)
    except subprocess.TimeoutExpired:
        raise DataError(f"{damaged} does not end; copy or export it again") from None
    except OSError as error:
        raise DataError(f"its reader cannot be started ({error.strerror}); export the file as CSV") from None
    head, _, numbers = done.stdout.partition(b"\n")
    if done.returncode or not head:
        raise DataError(f"{damaged} crashes; copy or export it again")
    answered = json.loads(head)
    if "error" in answered:
        raise DataError(answered["error"])
    layouts, values, start = [], np.frombuffer(numbers, dtype="<f8"), 0
    for table in answered["tables"]:
        rows, width = table["rows"], len(table["names"])
        columns = list(values[start : start + rows * width].reshape(width, rows).copy())
        facts = [(key, value) for key, value in table["facts"]]
        layouts.append(
            array_columns(table["names"], columns, table["notes"], name=table["name"], facts=facts)
        )
        start += rows * width
    return layouts


def answer() -> None:
    """Answer a parent process: call the reader that the arguments name on the standard input."""
    module, _, function = sys.argv[1].partition(":")
    try:
        layouts = getattr(importlib.import_module(module), function)(sys.stdin.buffer.read())
    except DataError as error:
        sys.stdout.buffer.write(json.dumps({"error": str(error)}).encode())
        return
    tables, numbers = [], []
    for layout in layouts:
        columns = [np.asarray(column, dtype="<f8") for column in layout.cells.columns]
        numbers += [column.tobytes() for column in columns]
        tables.append(
            {
                "names": layout.names,
                "rows": len(layout.cells),
                "notes": layout.remarks,
                "name": layout.name,
                "facts": layout.declared.facts,
            }
        )
    sys.stdout.buffer.write(json.dumps({"tables": tables}).encode() + b"\n" + b"".join(numbers))
