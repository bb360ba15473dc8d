"""Methods of results that show them: `report`, `plot`, `save`, and HTML for notebooks.

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

_PRESENT = "pellicle.reporting.present"


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
