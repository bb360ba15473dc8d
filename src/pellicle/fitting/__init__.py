"""Least-squares fits: minima, uncertainties, identifiability and status.

Public names are imported when first used: many modules below need little of what these import.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.fitting.film.functional import Prepared as Prepared
    from pellicle.fitting.film.functional import Solution as Solution
    from pellicle.fitting.film.functional import prepare as prepare
    from pellicle.fitting.film.functional import solve as solve
    from pellicle.fitting.repeated_measurements import Repeats as Repeats
    from pellicle.fitting.repeated_measurements import repeats as repeats

_MODULE: dict[str, str] = {
    "Prepared": "pellicle.fitting.film.functional",
    "Repeats": "pellicle.fitting.repeated_measurements",
    "Solution": "pellicle.fitting.film.functional",
    "prepare": "pellicle.fitting.film.functional",
    "repeats": "pellicle.fitting.repeated_measurements",
    "solve": "pellicle.fitting.film.functional",
}

__all__ = ["Prepared", "Repeats", "Solution", "prepare", "repeats", "solve"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'pellicle.fitting' has no attribute {name!r}")
    return getattr(import_module(_MODULE[name]), name)
