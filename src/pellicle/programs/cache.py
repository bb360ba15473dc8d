"""Compiled programs that outlive the process.

JAX's own cache saves the compilation; the rest of a start is tracing and lowering programs in Python. Where
a session has a compilation cache, programs are kept beside it, each under a key of everything that it depends
on. The next process neither traces nor lowers them, and does not import the solver. What is kept is machine
code where no one but the user can write the files (`make`); elsewhere (Windows, a shared folder, a
GPU) it is the traced program, which is data: JAX lowers it again and finds the machine code in its cache.

Loading machine code takes some milliseconds: nothing is traced, lowered or compiled. Machine code and the
`pickle` format around it can do anything that the user can, so files are read only where nobody else can have
written them. A file begins with a digest of its content and of the key under which it was kept.
"""

import hashlib
import logging
import os
import pickle
import re
import secrets
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias, get_type_hints

import jax
import numpy as np

from pellicle.errors import DataError, UsageError
from pellicle.files import replacing
from pellicle.programs.private_files import make_folder, read, write

log = logging.getLogger(__name__)

Program: TypeAlias = Callable[..., Any]
Options: TypeAlias = dict[str, str | bool]
"""Options of XLA."""

LIMIT = 256 * 2**20
"""Size of the folder (bytes) above which its oldest files are removed. A program takes 0.05 to 1 MB."""

Calls: TypeAlias = Literal["few", "some", "many"]
"""Calls of a program in one fit: once or twice, in a loop or for many candidates, for every pixel."""

_SOME: Options = {"xla_cpu_use_fusion_emitters": False, "xla_cpu_parallel_codegen_split_count": "1"}
_FEW: Options = {"xla_backend_optimization_level": "0", "xla_llvm_disable_expensive_passes": True}
_OPTIONS: dict[Calls, Options] = {"few": _SOME | _FEW, "some": _SOME, "many": {}}
"""XLA's older code generator compiles the programs of a fit in 5 to 22 s of processor time, not 7 to 30 s;
most run as fast within 20 %, those of a slow scale and offset a third slower (jaxlib 0.10, by
`benchmarks/fit.py` and `benchmarks/cold_start.py`). In one piece a program takes 10 to 35 % less, and without
optimisation half; it then runs at a third of the speed. Derivatives of hundreds of spectra at once run at a
third to two thirds of the speed (`benchmarks/map.py`): such programs have no options."""

_DIGEST = hashlib.sha256().digest_size
_CALLS = re.compile(r"custom_call @([\w.]+)")


@lru_cache(maxsize=3)
def compiler_options(calls: Calls) -> Options:
    """Options of XLA for programs of so many calls: those that it knows, and none for a GPU."""
    options = _OPTIONS[calls] if jax.default_backend() == "cpu" else {}
    return options if _are_known(options) else {k: x for k, x in options.items() if _are_known({k: x})}


def _are_known(options: Options) -> bool:
    """True where XLA has these options: jaxlib 0.11 has one code generator."""
    if options:
        try:
            jax.jit(lambda: 0.0).lower().compile(compiler_options=options)
        except jax.errors.JaxRuntimeError:
            return False
    return True


def load(path: Path, key: bytes) -> Program | None:
    """Load the program that `make` kept under the same path and key, or None if no trusted file exists."""
    content = read(path)
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
    function: Program,
    inputs: Sequence[jax.ShapeDtypeStruct],
    cache: Path,
    options: Options,
) -> Program | None:
    """Compile a function of arrays and keep its machine code at `path`; None where it cannot be kept.

    `cache` is the folder of JAX's own compilation cache, `options` are those of XLA.
    """
    if not make_folder(path.parent):
        return None
    # JAX makes no promise that a program from its own cache can be serialised again: a name of its own keeps
    # this one out of there.
    name = function.__name__ = f"program_{secrets.token_hex(8)}"
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
        write(path, _digest(key, body) + body, LIMIT)
    except Exception as error:
        log.info("the compiled program is not kept: %s", error)
    return compiled


def _digest(key: bytes, body: bytes) -> bytes:
    return hashlib.sha256(key + body).digest()


def _loaded(content: bytes, key: bytes) -> Callable[..., Any]:
    digest, body = content[:_DIGEST], content[_DIGEST:]
    if digest != _digest(key, body):
        raise ValueError("it is damaged, or belongs to another program")
    from jax.experimental import serialize_executable

    lapack, program = pickle.loads(body)
    if lapack:
        # a lowered program that calls LAPACK lets JAX find its addresses, without which other calls crash
        jax.jit(jax.lax.linalg.cholesky).lower(jax.ShapeDtypeStruct((1, 1), float))
    return serialize_executable.deserialize_and_load(*program, execution_devices=jax.devices()[:1])


class _Places(NamedTuple):
    """Structure of the arguments of a program, and which of its arrays stands at each leaf."""

    structure: Any
    order: tuple[int, ...]

    def filled(self, arrays: Sequence[Any]) -> Any:
        """The arguments."""
        return jax.tree_util.tree_unflatten(self.structure, [arrays[row] for row in self.order])


_LARGE = 0.125
"""Share of a compilation that a single call without a program takes at most: a fit makes some ten of them."""
_LEAST = 1 / 512
"""Share of a compilation that a call without a program takes at least, however few its points."""


def _usual_share(*_: Any) -> float:
    """Share of a compilation that a call takes without a program: a 20th to a 60th
    (`benchmarks/cold_start.py`)."""
    return 1 / 32


_at_once = ContextVar("at_once", default=False)


@contextmanager
def compiled_at_once() -> Iterator[None]:
    """Within, programs are compiled at their first call, whatever NumPy could do `at_first`."""
    token = _at_once.set(True)
    try:
        yield
    finally:
        _at_once.reset(token)


def kept(
    function: Program,
    *,
    calls: Calls = "some",
    at_first: Program | None = None,
    share: Program = _usual_share,
) -> Program:
    """`jax.jit` with the first argument static, kept on disk where there is a cache.

    `function(plan, *pytrees)` must be pure and return a named tuple of arrays; `plan` is hashable, and
    its `repr` says all that the program depends on. The arrays are NumPy's. With many `calls` it is compiled
    to run fast, with few in a short time. `at_first`, of the same arguments and results, takes the first
    calls of a program that is not kept yet, or returns None where it cannot. The `share` of such a call is
    its time in units of the compilation's: programs are compiled where the shares of all calls exceed 1, or
    that of one is large.
    """

    @lru_cache(maxsize=1)
    def jitted() -> Program:  # at the first call, which starts JAX's backend anyway
        @wraps(function)
        def whole(plan: Hashable, places: _Places, *arrays: Any) -> Any:
            return function(plan, *places.filled(arrays))

        return jax.jit(whole, static_argnums=(0, 1), compiler_options=compiler_options(calls))

    @wraps(function)
    def call(plan: Hashable, *arguments: Any) -> Any:
        folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
        leaves, structure = jax.tree_util.tree_flatten(arguments)
        # an array that stands in many places is one argument; that two numbers are one object is chance
        keys = [id(leaf) if np.ndim(leaf) else -at for at, leaf in enumerate(leaves)]
        own = dict(zip(keys, leaves, strict=True))
        rows = {key: row for row, key in enumerate(own)}
        places = _Places(structure, tuple(rows[key] for key in keys))
        shapes = tuple((np.shape(x), _dtype(x)) for x in own.values())
        # JAX can cache in a cloud, too
        program = function, calls, plan, places, shapes, None if "://" in str(folder) else folder
        if at_first is not None and _is_new(program, share(plan, *arguments)):
            result = at_first(plan, *arguments)
            if result is not None:
                return result
        if not program[-1]:
            return jax.device_get(jitted()(plan, places, *own.values()))
        arrays = [*map(np.asarray, own.values())]
        run, output = _load(*program)
        # NumPy's arrays are views of the program's own, and cheaper to work on
        return jax.tree_util.tree_unflatten(output, [np.asarray(leaf) for leaf in run(*arrays)])

    return call


def _dtype(x: Any) -> Any:
    return x.dtype if hasattr(x, "dtype") else np.result_type(x)


@lru_cache(maxsize=128)
def _load(
    function: Program, calls: Calls, plan: Hashable, places: _Places, shapes: tuple, folder: str
) -> tuple[Program, Any]:
    """The program as a function of flat arrays, and the structure of its results."""

    def flat(*arrays: Any) -> list[Any]:
        return jax.tree_util.tree_leaves(function(plan, *places.filled(arrays)))

    path, key = _place(function, calls, plan, places, shapes, folder)
    inputs = [jax.ShapeDtypeStruct(shape, np.dtype(dtype)) for shape, dtype in shapes]
    run = load(path, key) if jax.default_backend() == "cpu" else None
    if run is None:
        options = compiler_options(calls)  # found by compiling, which a kept program needs not
        if jax.default_backend() == "cpu":
            run = make(path, key, flat, inputs, Path(folder), options)
        if run is None:
            run = jax.jit(_traced(path.with_suffix(".export"), flat, inputs).call, compiler_options=options)
    kind = get_type_hints(function)["return"]
    return run, jax.tree_util.tree_structure(kind(*range(len(kind._fields))))


@lru_cache(maxsize=256)
def _place(
    function: Program, calls: Calls, plan: Hashable, places: _Places, shapes: tuple, folder: str
) -> tuple[Path, bytes]:
    """The file of a program, and its key."""
    from jaxlib.version import __version__ as jaxlib

    about = function.__module__, function.__qualname__, calls, repr(plan), str(places), str(shapes)
    # versions, device and settings that change a program
    settings = [jax.config.values[name] for name in ("jax_enable_x64", "jax_default_matmul_precision")]
    versions = jax.__version__, jaxlib, jax.default_backend(), _hardware(), os.environ.get("XLA_FLAGS", "")
    key = hashlib.sha256(repr((*about, (*versions, *settings), _sources())).encode()).digest()
    return Path(folder) / "programs" / key.hex(), key


def _is_new(program: tuple, share: float) -> bool:
    """True while the shares of the calls are below that of a compilation, of a program that no earlier
    process has kept."""
    spent = _spent_on(*program)
    spent[0] += max(share, _LEAST)
    few = share <= _LARGE and spent[0] <= 1
    return few and not _at_once.get() and not (program[-1] and _place(*program)[0].exists())


@lru_cache(maxsize=256)
def _spent_on(*program: Any) -> list[float]:
    """Sum of the shares of the calls of a program, in a list of one number that is changed."""
    return [0.0]


def _traced(path: Path, flat: Program, inputs: Sequence[jax.ShapeDtypeStruct]) -> Any:
    """The traced program at `path`, made if it is not there."""
    from jax import export

    try:
        return export.deserialize(bytearray(path.read_bytes()))
    except (OSError, ValueError, KeyError):  # absent, or cut short: made again
        program = export.export(jax.jit(flat))(*inputs)
        # a cache that cannot be written is no failure
        with suppress(OSError, UsageError, DataError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path, overwrite=True) as temporary:
                temporary.write_bytes(program.serialize())
        return program


@lru_cache(maxsize=1)
def _hardware() -> str:
    """JAX's fingerprint of the device: on a CPU it covers the instructions that the CPU has."""
    from jaxlib import xla_client

    return hex(xla_client.get_topology_for_devices(jax.devices()[:1]).fingerprint())


@lru_cache(maxsize=1)
def _sources() -> str:
    """Size and time of every source file: an edited package keeps no stale program."""
    root = Path(__file__).resolve().parents[1]
    stats = [(p.relative_to(root).as_posix(), p.stat()) for p in sorted(root.rglob("*.py"))]
    return repr([(name, s.st_size, s.st_mtime_ns) for name, s in stats])


def in_chunks(program: Callable[[Any], Any], rows: Any, size: int, few: int = 0) -> Any:
    """Call a compiled program for rows, `size` of them at a time, so that one program serves any number.

    **Arguments:** `rows`, a pytree of arrays (rows, ...); `few`, the size of the last chunk where no more
    rows are left. A chunk with fewer rows is padded by the last of them.

    **Returns:** the outputs of the program, a pytree of NumPy arrays (rows, ...).
    """
    count, pieces = len(jax.tree_util.tree_leaves(rows)[0]), []
    for first in range(0, count, size):
        left = min(size, count - first)
        padding = (few if left <= few else size) - left

        def chunk(
            x: np.ndarray, here: slice = slice(first, first + left), padding: int = padding
        ) -> np.ndarray:
            return np.concatenate([x[here], np.repeat(x[here][-1:], padding, axis=0)])

        results = program(jax.tree_util.tree_map(chunk, rows))
        pieces.append(jax.tree_util.tree_map(lambda x, left=left: np.asarray(x)[:left], results))
    return jax.tree_util.tree_map(lambda *each: np.concatenate(each), *pieces)
