"""Methods that show results: text, files, figures, tables, and HTML for notebooks.

Reports are made in `pellicle.reporting`, a folder above this one. The methods import it by name when they are
called, as pandas imports its plotting backends; it is the only import against the order of the folders.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

_PRESENT, _TABLES = "pellicle.reporting.present", "pellicle.reporting.fit_tables"


class ReportMixin:
    """Text, files and HTML of a result."""

    def report(self) -> str:
        """Return the full report as plain text, as `pellicle.report` does."""
        return import_module(_PRESENT).report(self)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write report, JSON record, tables and figures into `folder`, which is made if it is absent.

        Raises UsageError where the folder holds files that pellicle did not write, or cannot be written.
        """
        return import_module(_PRESENT).save(self, folder)

    def _repr_html_(self) -> str:
        return import_module(_PRESENT).html(self)


class PlotMixin(ReportMixin):
    """Text, files, HTML and figure of a result."""

    def plot(self) -> Figure:
        """Return a Matplotlib figure, which a notebook shows and `figure.savefig(path)` writes."""
        return import_module(_PRESENT).plot(self)


class FitMixin(ReportMixin):
    """Text, files, HTML, figure and tables of a fit."""

    def plot(self, width_mm: float | None = None) -> Figure:
        """Return a Matplotlib figure, which a notebook shows and `figure.savefig(path)` writes.

        With a `width_mm`, such as 86 of a journal's column, it has data, fit, residuals, n and k in letters
        of 7 points, and no title.
        """
        return import_module("pellicle.reporting.figures").draw_fit(self, width_mm)

    def to_dataframe(self) -> DataFrame:
        """Return the parameters as a pandas table, one a row, with both standard errors and the 95 % error.

        Raises UsageError without pandas.
        """
        return import_module(_TABLES).dataframe(self)

    def to_dataset(self) -> Dataset:
        """Return data, model, residuals, n and k against wavelength, and parameters, as an xarray dataset.

        Raises UsageError without xarray; ValueError for a joint fit (`fit.alone(part)` has one for each of
        its `parts`); TypeError for colours and BRDF samples.
        """
        return import_module(_TABLES).dataset(self)
