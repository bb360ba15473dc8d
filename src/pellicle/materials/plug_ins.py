"""Materials of other packages: entry points of the group `pellicle.materials`.

The name of an entry point is that of the material. Its object is a dispersion, the path of a file of n and k,
or a function without arguments that returns one of them. Names of the catalogue come first.
"""

from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path

from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import DataError

GROUP = "pellicle.materials"


def of_packages(name: str) -> AbstractDispersion | str | None:
    """The dispersion, or the path of the file, of a material of another package; None without one.

    Raises DataError where the package fails, or has something else under that name.
    """
    for point in entry_points(group=GROUP, name=name):
        failed = f"the material {name!r} ({point.value}) of another package"
        try:
            found = point.load()
            found = (
                found()
                if isinstance(found, Callable) and not isinstance(found, AbstractDispersion)
                else found
            )
        except Exception as error:
            raise DataError(f"{failed} fails to load ({error}); repair or uninstall that package") from None
        if isinstance(found, Path | str):
            return str(found)
        if isinstance(found, AbstractDispersion):
            return found
        raise DataError(f"{failed} is neither a dispersion nor a path, but {type(found).__name__}")
    return None
