"""What a command costs before it does anything: imports, and where compiled programs are kept."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pellicle.cli import main, session
from pellicle.recipes.dispersion_models import MODELS

TELL = "import sys; from pellicle.cli import main; code = main(); print(*sys.modules, file=sys.stderr); "


def run(*arguments, **environment):
    """The command in a process of its own; its modules are the last line of stderr."""
    command = [sys.executable, "-c", TELL + "sys.exit(code)", *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, env=os.environ | environment, check=False, timeout=300
    )


def modules(ran) -> set[str]:
    return {name.split(".")[0] for name in ran.stderr.splitlines()[-1].split()}


@pytest.mark.parametrize("arguments", [("--help",), ("fit", "--help"), ("--version",)])
def test_help_is_light(arguments):
    ran = run(*arguments)
    assert ran.returncode == 0
    assert not modules(ran) & {"jax", "pandas", "matplotlib", "numpy", "equinox", "optimistix", "pydantic"}
    assert "fit" in ran.stdout or arguments == ("--version",)


def test_help_names_every_model(pellicle):
    ran = pellicle("fit", "--help")
    words = re.sub(r"[│\s]+", " ", ran.out).replace(",", " ").split()
    assert set(MODELS) <= set(words)


def test_a_plain_fit_imports_nothing_slow_and_keeps_its_programs(spectrum_file, scene, tmp_path):
    cache = tmp_path / "programs"
    ran = run(
        "fit", spectrum_file(), *scene, "--json", PELLICLE_CACHE=str(cache), HOME=str(tmp_path / "home")
    )
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["status"] == "converged"
    assert not modules(ran) & {"matplotlib", "pint", "colour", "emcee", "arviz", "scipy.optimize"}
    assert any(cache.iterdir())
    assert not (tmp_path / "home").exists()


def test_no_cache_where_it_is_off(spectrum_file, tmp_path):
    flags = ("--layer", "1.46", "--substrate", "3.9", "--thickness", "299:301")
    home = tmp_path / "home"
    home.mkdir()
    folders = {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    ran = run("fit", spectrum_file(), *flags, PELLICLE_CACHE="off", **folders)
    assert ran.returncode in (0, 4), ran.stderr
    assert not list(home.iterdir())


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
