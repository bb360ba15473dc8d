"""Compiled programs that outlive the process.

XLA's own cache saves the compilation; the rest of a cold start is tracing the solver in Python. Where a
session has a compilation cache, the traced program is kept beside it, keyed by everything that it depends
on, and the next process neither traces it nor imports the solver.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Hashable
from contextlib import suppress
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, get_type_hints

import jax
import numpy as np

Program = Callable[..., Any]


def kept(function: Program) -> Program:
    """`jax.jit` with the first argument static, kept on disk where there is a cache.

    `function(plan, *pytrees)` must be pure and return a named tuple of arrays; `plan` is hashable, and
    its `repr` says all that the program depends on.
    """
    jitted = jax.jit(function, static_argnums=0)

    @wraps(function)
    def call(plan: Hashable, *arguments: Any) -> Any:
        folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
        if not folder:
            return jitted(plan, *arguments)
        leaves, structure = jax.tree_util.tree_flatten(arguments)
        arrays = [np.asarray(leaf) for leaf in leaves]
        shapes = tuple((a.shape, a.dtype.str) for a in arrays)
        run, output = _load(function, plan, structure, shapes, folder)
        return jax.tree_util.tree_unflatten(output, run(*arrays))

    return call


@lru_cache(maxsize=128)
def _load(
    function: Program, plan: Hashable, structure: Any, shapes: tuple, folder: str
) -> tuple[Program, Any]:
    """The program as a function of flat arrays, and the structure of its results."""
    from jax import export

    def flat(*arrays: Any) -> list[Any]:
        return jax.tree_util.tree_leaves(function(plan, *jax.tree_util.tree_unflatten(structure, arrays)))

    about = function.__qualname__, repr(plan), str(structure), shapes, jax.__version__, jax.default_backend()
    key = hashlib.sha256(repr((*about, _sources())).encode()).hexdigest()
    path = Path(folder) / "programs" / f"{key}.bin"
    try:
        program = export.deserialize(bytearray(path.read_bytes()))
    except (OSError, ValueError, KeyError):  # absent, or cut short: made again
        program = export.export(jax.jit(flat))(
            *[jax.ShapeDtypeStruct(shape, np.dtype(dtype)) for shape, dtype in shapes]
        )
        # whole or not at all; a cache that cannot be written is no failure
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=path.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(program.serialize())
            os.replace(name, path)
    kind = get_type_hints(function)["return"]
    return jax.jit(program.call), jax.tree_util.tree_structure(kind(*range(len(kind._fields))))


@lru_cache(maxsize=1)
def _sources() -> str:
    """Size and time of every source file: an edited package keeps no stale program."""
    root = Path(__file__).resolve().parents[1]
    stats = [(p.relative_to(root).as_posix(), p.stat()) for p in sorted(root.rglob("*.py"))]
    return repr([(name, s.st_size, s.st_mtime_ns) for name, s in stats])
