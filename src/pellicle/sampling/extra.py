"""What sampling needs beyond the package's own dependencies."""

from __future__ import annotations

from importlib.util import find_spec

PACKAGES = ("emcee", "arviz", "corner", "h5py")


def missing() -> list[str]:
    """The packages that are not installed; none of them is imported."""
    return [name for name in PACKAGES if find_spec(name) is None]
