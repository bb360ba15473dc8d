"""Programs kept between processes: which files are loaded, which are not."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.programs import cache as program_cache
from pellicle.programs import private_files
from pellicle.programs.cache import kept

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no owners")

KEY = b"key of one program"
VECTOR = [jax.ShapeDtypeStruct((3,), np.float64)]


@pytest.fixture
def path(tmp_path) -> Path:
    """A program x + 1 that is kept."""
    path = tmp_path / "programs" / "one"
    assert program_cache.make(path, KEY, lambda x: [x + 1], VECTOR, tmp_path, {}) is not None
    return path


def test_a_kept_program_computes_what_was_compiled(path):
    program = program_cache.load(path, KEY)
    np.testing.assert_array_equal(program(np.arange(3.0))[0], [1, 2, 3])


@pytest.mark.slow
def test_a_program_that_calls_lapack_runs_in_a_new_process(tmp_path):
    """Without the initialisation of LAPACK that process is killed by a signal."""
    path, matrix = tmp_path / "programs" / "one", [jax.ShapeDtypeStruct((2, 2), np.float64)]
    assert program_cache.make(path, KEY, lambda x: [jnp.linalg.cholesky(x)], matrix, tmp_path, {}) is not None
    code = (
        "import sys, pathlib, jax, numpy as np; jax.config.update('jax_enable_x64', True)\n"
        "from pellicle.programs import cache\n"
        f"program = cache.load(pathlib.Path({str(path)!r}), {KEY!r})\n"
        "print(float(np.asarray(program(np.array([[4.0, 2.0], [2.0, 5.0]]))[0]).sum()))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout.strip(), ran.stderr) == (0, "5.0", "")


def test_an_option_that_xla_does_not_have_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(program_cache, "_OPTIONS", {"some": {"xla_of_another_version": True}})
    monkeypatch.setattr(program_cache, "compiler_options", program_cache.compiler_options.__wrapped__)
    path, options = tmp_path / "programs" / "one", program_cache.compiler_options("some")
    program = program_cache.make(path, KEY, lambda x: [x + 1], VECTOR, tmp_path, options)
    np.testing.assert_array_equal(program(np.arange(3.0))[0], [1, 2, 3])


def link(path):
    path.with_name("two").symlink_to(path)
    path.parent.with_name("linked").symlink_to(path.parent)
    assert not private_files.make_folder(path.parent.with_name("linked"))


DAMAGE = {
    "group may write": lambda path: path.chmod(0o620),
    "others may write": lambda path: path.chmod(0o602),
    "group may write into the folder": lambda path: path.parent.chmod(0o720),
    "others may write into the folder": lambda path: path.parent.chmod(0o702),
    "empty": lambda path: path.write_bytes(b""),
    "begun": lambda path: path.write_bytes(path.read_bytes()[:20]),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "a bit turned": lambda path: path.write_bytes(
        bytes(x ^ (i == 1000) for i, x in enumerate(path.read_bytes()))
    ),
    "link": link,
    "pipe": lambda path: os.mkfifo(path.with_name("pipe"), 0o600),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_what_may_not_be_ours_is_neither_loaded_nor_unpickled(path, monkeypatch, name):
    """Nor does a pipe stop the process."""
    unpickled = []
    DAMAGE[name](path)
    monkeypatch.setattr(program_cache.pickle, "loads", unpickled.append)
    places = {"link": [path.with_name("two"), path.parent.with_name("linked") / path.name]}
    for place in (places | {"pipe": [path.with_name("pipe")]}).get(name, [path]):
        assert program_cache.load(place, KEY) is None
    assert program_cache.load(path, b"another key") is None
    assert not unpickled


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("given", ["one", "."])
def test_a_file_or_folder_that_was_given_away_is_not_loaded(path, given):
    os.chown(path.parent / given, 12345, -1)
    assert program_cache.load(path, KEY) is None


def test_what_cannot_be_deserialised_is_not_loaded(path):
    body = program_cache.pickle.dumps((False, (b"no program", None, None)))
    path.write_bytes(program_cache._digest(KEY, body) + body)
    assert program_cache.load(path, KEY) is None


def test_a_file_or_folder_of_another_user_is_not_loaded(path, monkeypatch):
    owner = os.stat(path).st_uid
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    assert program_cache.load(path, KEY) is None
    assert program_cache.make(path, KEY, lambda x: [x + 1], VECTOR, path.parent, {}) is None


def test_the_oldest_files_make_room(tmp_path):
    folder = tmp_path / "programs"
    assert private_files.make_folder(folder)
    for age, name in enumerate(["new", "older", "oldest"]):
        private_files.write(folder / name, bytes(100), 1000)
        os.utime(folder / name, (1e9 - age, 1e9 - age))
    private_files.write(folder / "last", bytes(100), 250)
    assert {file.name for file in folder.iterdir()} == {"new", "last"}


class Sum(NamedTuple):
    total: Any


TRACED = []


def plain_scaled(factor: float, x: Any) -> Sum:
    TRACED.append(factor)
    return Sum(factor * jnp.sum(x))


scaled = kept(plain_scaled)


@pytest.fixture
def new_process():
    """Forget the programs of this process, as a new one would."""
    TRACED.clear()

    def clear():
        for remembered in (program_cache._load, program_cache._place, program_cache._spent_on):
            remembered.cache_clear()

    clear()
    yield clear
    clear()


@pytest.fixture
def cache(tmp_path):
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def test_a_program_is_traced_once_in_all_processes(cache, new_process):
    for _ in range(3):
        assert scaled(2, np.arange(4.0)).total == 12
        assert scaled(2, np.arange(4.0)).total == 12
        new_process()
    assert TRACED == [2]


def test_formulas_without_a_program_take_the_first_calls(cache, new_process):
    """Until their shares of a compilation sum to 1, one is large, or another process has kept the program."""
    given = []

    def by_numpy(factor, x):
        given.append(factor)
        return Sum(factor * np.sum(x)) if factor < 10 else None

    either = kept(plain_scaled, at_first=by_numpy, share=lambda factor, x: len(x) / 40)
    assert [float(either(2, np.arange(4.0)).total) for _ in range(12)] == [12.0] * 12
    assert (given, TRACED) == ([2] * 10, [2])
    assert either(2, np.arange(5.0)).total == 20  # another program
    assert len(given) == 11
    assert either(3, np.arange(6.0)).total == 45  # more than an eighth
    assert (len(given), TRACED.pop()) == (11, 3)
    assert either(10, np.arange(4.0)).total == 60  # nothing without a program
    assert TRACED == [2, 10]
    new_process()
    given.clear()
    assert either(2, np.arange(4.0)).total == 12
    assert (given, TRACED) == ([], [2, 10])


def test_formulas_take_the_first_calls_without_a_cache(cache, new_process):
    jax.config.update("jax_compilation_cache_dir", None)
    either = kept(plain_scaled, at_first=lambda factor, x: Sum(-factor * np.sum(x)), share=lambda *_: 0.125)
    assert [float(either(5, np.arange(4.0)).total) for _ in range(10)] == [-30.0] * 8 + [30.0] * 2


def test_a_program_is_kept_by_its_plan_its_shapes_and_the_settings(cache, new_process, monkeypatch):
    scaled(2, np.arange(4.0))
    assert scaled(3, np.arange(4.0)).total == 18
    assert scaled(2, np.arange(5.0)).total == 20
    assert scaled(2, np.arange(4.0, dtype=np.float32)).total.dtype == np.float32
    assert len(TRACED) == 4
    for change in ({"XLA_FLAGS": "--xla_cpu_max_isa=AVX"}, {"XLA_FLAGS": ""}):
        monkeypatch.setenv(*next(iter(change.items())))
        new_process()
        scaled(2, np.arange(4.0))
    assert len(TRACED) == 6
    monkeypatch.setattr(program_cache, "_hardware", lambda: "another CPU")
    new_process()
    scaled(2, np.arange(4.0))
    assert len(TRACED) == 7


ONE = []


def joined(plan: int, arrays: list[Any]) -> Sum:
    ONE.append(len({id(x) for x in arrays}))
    return Sum(sum(jnp.sum(x) for x in arrays))


@pytest.mark.parametrize("cached", [True, False])
def test_an_array_in_two_places_is_one_argument(cache, new_process, cached):
    if not cached:
        jax.config.update("jax_compilation_cache_dir", None)
    run, x, number = kept(joined), np.arange(3.0), 2.0
    assert run(1, [x, number, x, number]).total == 10
    assert run(1, [x, 5.0, x, 6.0]).total == 17  # numbers that are one object are one by chance
    assert run(1, [x, number, 2 * x, number]).total == 13
    assert ONE[-2:] == [3, 4]


@pytest.mark.parametrize("cached", [True, False])
def test_programs_of_many_calls_have_no_options(cache, new_process, monkeypatch, cached, refuses):
    """XLA refuses an option that it does not have."""
    of_another_version = {"some": {"xla_of_another_version": True}, "many": {}}
    monkeypatch.setattr(program_cache, "compiler_options", of_another_version.get)
    if not cached:
        jax.config.update("jax_compilation_cache_dir", None)
    assert kept(plain_scaled, calls="many")(2, np.arange(4.0)).total == 12
    refuses(jax.errors.JaxRuntimeError, "xla_of_another_version", scaled, 2, np.arange(5.0))


@pytest.mark.parametrize("owners", [False, True])
def test_without_owners_or_in_a_folder_of_others_the_traced_program_is_kept(
    cache, new_process, monkeypatch, owners
):
    if owners:
        (cache / "programs").mkdir()
        (cache / "programs").chmod(0o777)
    else:
        monkeypatch.delattr(os, "geteuid")
    for _ in range(2):
        assert scaled(2, np.arange(4.0)).total == 12
        new_process()
    assert TRACED == [2]
    assert [file.suffix for file in (cache / "programs").iterdir()] == [".export"]
