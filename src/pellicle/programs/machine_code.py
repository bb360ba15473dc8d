"""Machine code of compiled programs, kept in files.

Loading it takes some milliseconds: nothing is traced, lowered or compiled. Machine code and the `pickle`
format around it can do anything that the user can, so files are read only as `private_files` allows. A file
begins with a digest of its content and of the key under which it was kept.
"""

from __future__ import annotations

import hashlib
import logging
import pickle
import re
import secrets
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import jax

from pellicle.programs import private_files

log = logging.getLogger(__name__)

LIMIT = 256 * 2**20
"""Size of the folder (bytes) above which its oldest files are removed. A program takes 0.05 to 1 MB."""

_OPTIONS: dict[str, str | bool] = {"xla_cpu_use_fusion_emitters": False}
"""XLA's older code generator compiles the programs of a fit in 5 to 22 s of processor time, not 7 to 30 s;
most run as fast within 20 %, those of a slow scale and offset a third slower (jaxlib 0.10, by
`benchmarks/fit.py` and `benchmarks/cold_start.py`). Derivatives of hundreds of spectra at once run at a third
to two thirds of the speed (`benchmarks/map.py`): such programs are called often, and have no options."""

_DIGEST = hashlib.sha256().digest_size
_CALLS = re.compile(r"custom_call @([\w.]+)")


@lru_cache(maxsize=1)
def compiler_options() -> dict[str, str | bool]:
    """Options of XLA for the programs of a fit; none for a GPU, or for an XLA that lacks them."""
    if jax.default_backend() != "cpu":
        return {}
    try:
        jax.jit(lambda: 0.0).lower().compile(compiler_options=_OPTIONS)
    except jax.errors.JaxRuntimeError:
        return {}
    return _OPTIONS


def load(path: Path, key: bytes) -> Callable[..., Any] | None:
    """Load the program that `make` kept under the same path and key, or None if no trusted file exists."""
    content = private_files.read(path)
    if content is None:
        return None
    try:
        return _loaded(content, key)
    except Exception as error:  # pickle and XLA raise many kinds
        log.info("%s is compiled again: %s", path, error)
        return None


def make(
    path: Path,
    key: bytes,
    function: Callable[..., Any],
    inputs: Sequence[jax.ShapeDtypeStruct],
    cache: Path,
    options: dict[str, str | bool],
) -> Callable[..., Any] | None:
    """Compile a function of arrays and keep its machine code at `path`; None where it cannot be kept.

    `cache` is the folder of JAX's own compilation cache, `options` are those of XLA.
    """
    if not private_files.make_folder(path.parent):
        return None
    # JAX makes no promise that a program from its own cache can be serialised again: a name of its own keeps
    # this one out of there.
    name = f"program_{secrets.token_hex(8)}"
    function.__name__ = name
    lowered = jax.jit(function).lower(*inputs)
    calls = set(_CALLS.findall(lowered.as_text()))
    if any(not call.startswith("lapack_") for call in calls):
        return None  # a library that the loading process may not have initialised
    from jax.experimental import serialize_executable

    compiled = lowered.compile(compiler_options=options)
    with suppress(OSError):
        for copy in cache.glob(f"*{name}*"):
            copy.unlink()
    try:
        body = pickle.dumps((bool(calls), serialize_executable.serialize(compiled)))
        content = _digest(key, body) + body
        program = _loaded(content, key)  # this process runs what later ones will
        private_files.write(path, content, LIMIT)
    except Exception as error:
        log.info("the compiled program is not kept: %s", error)
        return compiled
    return program


def _digest(key: bytes, body: bytes) -> bytes:
    return hashlib.sha256(key + body).digest()


def _loaded(content: bytes, key: bytes) -> Callable[..., Any]:
    digest, body = content[:_DIGEST], content[_DIGEST:]
    if digest != _digest(key, body):
        raise ValueError("it is damaged, or belongs to another program")
    from jax.experimental import serialize_executable

    lapack, program = pickle.loads(body)
    if lapack:
        _initialise_lapack()
    return serialize_executable.deserialize_and_load(*program, execution_devices=jax.devices()[:1])


def _initialise_lapack() -> None:
    """Lower a program that calls LAPACK: JAX then finds its addresses, without which other calls crash."""
    jax.jit(jax.lax.linalg.cholesky).lower(jax.ShapeDtypeStruct((1, 1), float))
