"""Settings and fixtures of all tests: float64, runtime type checks, a compilation cache."""

import dataclasses
import functools
import gc
import importlib
import importlib.util
import inspect
import os
import shutil
import signal
import sys
import types
import typing
from contextlib import contextmanager
from pathlib import Path

import hypothesis
import jax
import jaxtyping
import pytest

ROOT = Path(__file__).resolve().parents[1]
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

jax.config.update("jax_enable_x64", True)
# compiled programs are reused by later runs; the user's own cache is not touched
jax.config.update("jax_compilation_cache_dir", str(ROOT / ".pytest_cache" / "jax"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)

# Python objects of JAX's caches accumulate: collecting garbage among them takes a tenth of the time otherwise
gc.set_threshold(50_000, 20, 20)


def checked_from_first_call(function=None, *, typechecker, of=jaxtyping.jaxtyped):
    """Decorate as `jaxtyped` does, compiling the checks of a function when it is first called.

    Most of the functions that a test imports are never called: 10 s of processor time a process, not 35 s.
    Arguments are checked once; `jaxtyped` binds them to the signature, checks them before the call and again
    with the result, which took a seventh of the tests' time.
    """
    if function is None:
        return functools.partial(checked_from_first_call, typechecker=typechecker)
    if not isinstance(function, types.FunctionType):
        if dataclasses.is_dataclass(function) and isinstance(function.__init__, types.FunctionType):
            function.__init__ = checked_from_first_call(function.__init__, typechecker=typechecker)
        return function
    if not function.__annotations__:
        return function
    try:
        typing.get_type_hints(function, include_extras=True)
    except Exception:  # a name that is defined later, whose objects jaxtyping does not check
        return of(function, typechecker=typechecker)
    if inspect.isgeneratorfunction(function):  # its body runs after the call
        return of(function, typechecker=typechecker)
    checked = None

    @functools.wraps(function)
    def call(*arguments, **named):
        nonlocal checked
        checked = checked or typechecker(function)
        with SIZES:
            return checked(*arguments, **named)

    return call


SIZES = jaxtyping.jaxtyped("context")
"""In it, arguments and result of one call have the same sizes by name."""
jaxtyping.jaxtyped = checked_from_first_call
# must come before the package is imported: annotated arguments and results are checked at run time, except in
# two modules whose functions are called for each traced operation (a tenth of the time); int is accepted for
# float, as by type checkers
UNCHECKED = {"pellicle.optics.pair", "pellicle.scene.free"}
_files = (path.relative_to(ROOT / "src").with_suffix("") for path in (ROOT / "src/pellicle").rglob("*.py"))
jaxtyping.install_import_hook(
    sorted({".".join(file.parts) for file in _files if file.name != "__init__"} - UNCHECKED),
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True, violation_type=TypeError))",
)

# a job in the background of a shell ignores SIGINT, and passes that on
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# the same examples in every run, so that a failure is reproducible
hypothesis.settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, max_examples=100
)
hypothesis.settings.load_profile("tests")


@pytest.fixture(autouse=True, scope="module")
def few_maps_of_memory():
    """Forget compiled programs before their maps of memory are as many as Linux allows a process, 65 530: XLA
    then crashes, at the end of all tests in one process."""
    yield
    maps = Path("/proc/self/maps")
    if maps.exists() and maps.read_bytes().count(b"\n") > 45_000:
        jax.clear_caches()


@pytest.fixture(scope="session")
def with_part():
    """Return a function that copies a fit with changed fields of its only spectrum."""
    return _with_part


def _with_part(fit, **changes):
    [part] = fit.parts
    return dataclasses.replace(fit, parts=(dataclasses.replace(part, **changes),))


@pytest.fixture(scope="session")
def load_script():
    """Return a function that imports a file of scripts/ or benchmarks/ as a module."""

    def load_script(path: str):
        spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load_script


@pytest.fixture
def compiled():
    """List that grows by an event for each operation that JAX traces, lowers or compiles."""
    events = []

    def listen(event, seconds, **_):
        if event.startswith("/jax/core/compile/"):
            events.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    yield events
    jax.monitoring.unregister_event_duration_listener(listen)


@pytest.fixture(scope="session")
def modules_of():
    """Return a context of the modules of a folder that is no package, by their names."""

    @contextmanager
    def modules_of(folder: Path, *names: str):
        before = set(sys.modules)
        with pytest.MonkeyPatch.context() as patch:
            patch.syspath_prepend(folder)
            yield {name: importlib.import_module(name) for name in names}
        for name in set(sys.modules) - before:
            if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
                del sys.modules[name]

    return modules_of


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measurements that are kept beside the repository."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no measurements at {folder.relative_to(ROOT.parent)} beside the repository")
    return folder


@pytest.fixture
def write(tmp_path):
    """Return a function that writes text or bytes to a small file and returns its path."""

    def write(content, name="film.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def refusal():
    """Return `refusal(read, path, error, *parts)`, which expects `error` (or one of several) of `read(path)`.

    Its message, which is returned, must be one sentence that begins with the file's name and contains every
    one of `parts`.
    """

    def refusal(read, path, error, *parts, **kwargs):
        with pytest.raises(error) as caught:
            read(path, **kwargs)
        message = str(caught.value)
        assert type(caught.value) in (error if isinstance(error, tuple) else (error,))
        assert message.startswith(str(path))
        sentence = message.removeprefix(str(path))  # the path must not supply the words
        for part in parts:
            assert part in sentence, message
        assert "\n" not in message
        assert not message.endswith(".")
        return message

    return refusal


@pytest.fixture(scope="session")
def refuses():
    """Return `refuses(error, words, call, *arguments)`: a call raises it in a line with `words`."""

    def refuses(error, words, call, *arguments, **named):
        with pytest.raises(error, match=words) as caught:
            call(*arguments, **named)
        assert "\n" not in str(caught.value)

    return refuses


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium, which PELLICLE_BROWSER may name; skips where it or Playwright is absent."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is absent: make browser-tests")
    found = os.environ.get("PELLICLE_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip("there is no Chromium: install it, or name one in PELLICLE_BROWSER")
    with playwright.sync_playwright() as driver:
        with_root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
        chromium = driver.chromium.launch(executable_path=found, args=with_root)
        yield chromium
        chromium.close()
