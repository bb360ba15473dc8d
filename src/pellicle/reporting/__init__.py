"""Reports: text, figures, tables and result folders.

`report`, `plot` and `save` take any result: a fit, a posterior, a comparison, a plan, or a cost.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.reporting.present import plot as plot
    from pellicle.reporting.present import report as report
    from pellicle.reporting.present import save as save


def __getattr__(name: str) -> Any:
    # imported when first used: they import every kind of result, and JAX with it
    if name not in ("plot", "report", "save"):
        raise AttributeError(f"module 'pellicle.reporting' has no attribute {name!r}")
    from pellicle.reporting import present

    return getattr(present, name)
