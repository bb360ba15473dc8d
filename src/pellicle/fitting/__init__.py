"""Least-squares fits: minima, uncertainties, identifiability and status.

Public names are imported when first used: many modules below need little of what these import.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.fitting.repeated_measurements import Repeats as Repeats
    from pellicle.fitting.repeated_measurements import repeats as repeats
    from pellicle.fitting.spectra.functional import Prepared as Prepared
    from pellicle.fitting.spectra.functional import Solution as Solution
    from pellicle.fitting.spectra.functional import prepare as prepare
    from pellicle.fitting.spectra.functional import solve as solve

_MODULE: dict[str, str] = {
    "Prepared": "pellicle.fitting.spectra.functional",
    "Repeats": "pellicle.fitting.repeated_measurements",
    "Solution": "pellicle.fitting.spectra.functional",
    "prepare": "pellicle.fitting.spectra.functional",
    "repeats": "pellicle.fitting.repeated_measurements",
    "solve": "pellicle.fitting.spectra.functional",
}

__all__ = ["Prepared", "Repeats", "Solution", "prepare", "repeats", "solve"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'pellicle.fitting' has no attribute {name!r}")
    return getattr(import_module(_MODULE[name]), name)
