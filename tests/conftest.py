"""What every test runs under: float64, runtime type checks, and a compilation cache of its own."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import hypothesis
import jax
import jaxtyping
import pytest

ROOT = Path(__file__).resolve().parents[1]

jax.config.update("jax_enable_x64", True)
# programs compiled by one run serve the next, without touching the user's own cache
jax.config.update("jax_compilation_cache_dir", str(ROOT / ".pytest_cache" / "jax"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)

# before anything imports the package: every annotated argument and result is checked at run time;
# an int is a float, as everywhere else in Python's typing
jaxtyping.install_import_hook(
    "pellicle", "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"
)

# the same examples in every run: a failure is a finding, not a draw of luck
hypothesis.settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, max_examples=100
)
hypothesis.settings.load_profile("tests")


@pytest.fixture(scope="session")
def with_part():
    """Makes the same fit with other facts of its only spectrum."""
    return _with_part


def _with_part(fit, **changes):
    [part] = fit.parts
    return dataclasses.replace(fit, parts=(dataclasses.replace(part, **changes),))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Measurements that are kept beside the repository and not in it."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no measurements at {folder.relative_to(ROOT.parent)} beside the repository")
    return folder


@pytest.fixture
def write(tmp_path):
    """Writes a small file and gives its path."""

    def write(text, name="film.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.fixture
def refusal():
    """refusal(read, path, error, *said): reads, expects `error`, and finds every one of `said` in one
    sentence that starts with the file's name."""

    def refusal(read, path, error, *said, **kwargs):
        with pytest.raises(error) as caught:
            read(path, **kwargs)
        message = str(caught.value)
        assert type(caught.value) is error
        assert message.startswith(str(path))  # and only what follows may hold the words looked for
        for words in said:
            assert words in message.removeprefix(str(path)), message
        assert "\n" not in message
        assert not message.endswith(".")

    return refusal
