"""The command line in this process: quick, with its two streams and its exit code."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from pellicle.cli import main
from pellicle.dispersion import Constant
from pellicle.simulation.functions import reflectance


@dataclass(frozen=True)
class Ran:
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def objects(self) -> list[dict[str, Any]]:
        """stdout as strict JSON, one object a line."""

        def refuse(constant):
            raise ValueError(f"{constant} is not JSON")

        return [json.loads(line, parse_constant=refuse) for line in self.out.splitlines()]

    def refused(self, code: int, *words: str) -> None:
        """Check the exit code, that nothing is on stdout, and one sentence on stderr with all `words`."""
        assert (self.code, self.out) == (code, ""), self.err
        complaints = [line for line in self.err.splitlines() if line.startswith("pellicle: ")]
        assert len(complaints) == 1, self.err
        assert [word for word in words if word not in complaints[0]] == [], complaints[0]
        assert "Traceback" not in self.err


@pytest.fixture
def pellicle(monkeypatch, capsys) -> Callable[..., Ran]:
    """Runs `pellicle ARGUMENTS` without the user's cache of programs; `code` is the exit code to check."""
    monkeypatch.setenv("PELLICLE_CACHE", "off")

    def run(*arguments: Any, code: int | None = None) -> Ran:
        monkeypatch.setattr(sys, "argv", ["pellicle", *map(str, arguments)])
        capsys.readouterr()
        ran = Ran(main(), *capsys.readouterr())
        assert code is None or ran.code == code, ran.err
        return ran

    return run


@pytest.fixture
def spectrum_file(write) -> Callable[..., Any]:
    """Writes a spectrum of 1.46 on 3.9 + 0.02i: 100 points with noise of 0.002, so 128 once padded."""

    def file(name: str = "oxide.csv", thickness: float = 300.0, seed: int = 0, index: float = 1.46):
        nm = np.linspace(400.0, 796.0, 100)
        clean = np.asarray(reflectance(nm, thickness, Constant(index), Constant(3.9, 0.02)))
        values = clean + np.random.default_rng(seed).normal(0, 0.002, nm.size)
        rows = "".join(f"{w:g},{r:.6f}\n" for w, r in zip(nm, values, strict=True))
        return write("wavelength_nm,R\n" + rows, name)

    return file


SCENE = ("--layer", "1.46", "--substrate", "3.9+0.02j", "--thickness", "10:800")


@pytest.fixture
def scene() -> tuple[str, ...]:
    """The flags of the scene that `spectrum_file` was simulated from."""
    return SCENE


@pytest.fixture
def scene_recipe(write) -> Callable[..., Any]:
    """Writes the recipe of this scene, or of other media, with more lines in its tables and at its end."""

    def recipe(data="", name="film.toml", material="1.46", substrate="3.9+0.02j", end="", scene=""):
        layer = f"[[scene.layer]]\nmaterial = {material}\nthickness = {{ lower = 10, upper = 800 }}\n"
        return write(f"[data]\n{data}\n[scene]\nsubstrate = '{substrate}'\n{scene}\n{layer}{end}", name)

    return recipe
