"""Pellicle: thickness and refractive index of thin layers from measured spectra and BRDF samples.

Names are imported when first used, so that the command line answers before JAX is imported. The stub
`__init__.pyi` lists them, for type checkers and for this module.
"""

import ast
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8"))
_MODULE = {
    alias.name: node.module
    for node in _STUB.body
    if isinstance(node, ast.ImportFrom) and node.module
    for alias in node.names
    if alias.asname
}
_NAMESPACES = {
    "dispersion": "pellicle.dispersion",
    "fitting": "pellicle.fitting",
    "mixing": "pellicle.dispersion.effective_medium",
    "priors": "pellicle.scene.priors",
    "profile": "pellicle.dispersion.profiles",
}

__all__ = sorted({*_MODULE, *_NAMESPACES})  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("pellicle")
    if name in _NAMESPACES:
        return import_module(_NAMESPACES[name])
    if name not in _MODULE:
        raise AttributeError(f"module 'pellicle' has no attribute {name!r}")
    return getattr(import_module(_MODULE[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
