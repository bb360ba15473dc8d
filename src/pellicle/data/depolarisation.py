"""Columns of a measured depolarisation, 1 − N² − C² − S², beside those of Ψ and Δ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellicle.data.tabular.column_selection import only
from pellicle.data.tabular.columns import Column
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError
from pellicle.signals.limits import check_depolarisation, refuse_first


def columns(table: Table, every: Sequence[Column]) -> tuple[Column, ...]:
    """The depolarisation and, if there is one, its standard deviation. Raises DataError."""
    share, error = only(table, every, "depolarisation"), only(table, every, "sigma_depolarisation")
    if share is None:
        return ()
    chosen = (share, error) if error else (share,)
    for column in chosen:
        if column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; write a "
                "depolarisation as a fraction, or in percent with % in the column's name"
            )
    return chosen


def notes(columns: Sequence[Column]) -> list[str]:
    """A sentence on each column."""
    meanings = ("the depolarisation", "its standard deviation")
    return [
        f"{column.name!r} read as {meaning}, {'in percent' if column.unit == 'percent' else 'a fraction'}"
        for column, meaning in zip(columns, meanings, strict=False)
    ]


def fractions(columns: Sequence[Column], values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The values of the columns as fractions."""
    pairs = zip(columns, values, strict=True)
    return [own / 100.0 if column.unit == "percent" else own for column, own in pairs]


def check(table: Table, columns: Sequence[Column], rows: np.ndarray, values: Sequence[np.ndarray]) -> None:
    """Refuse a depolarisation that is no fraction, or errors of it not above zero. Raises DataError."""
    remedy = "correct or delete that row"
    if columns:
        where = table.places(columns[0].position, rows)
        percent = "if it is in percent, name the column `depolarisation (%)`"
        check_depolarisation(values[0], where, remedy if columns[0].unit == "percent" else percent)
    for column, error in zip(columns[1:], values[1:], strict=True):
        where = table.places(column.position, rows)
        refuse_first(error, error <= 0, where, f"is a standard deviation not above zero; {remedy}")
