"""Materials of another package, found by their entry points."""

import sys

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import DataError
from pellicle.materials import material

TOY = """
from pathlib import Path

from pellicle.dispersion import Constant

glaze = Constant(1.7)
ochre = Path(__file__).with_name("ochre.csv")

def varnish():
    return Constant(1.5)

def broken():
    raise KeyError("no table")

wrong = 1.5
"""
NAMES = ("glaze", "ochre", "varnish", "broken", "wrong", "SiO2")


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The toy package, as an installer leaves it."""
    about = tmp_path / "pellicle_pigments-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: pellicle-pigments\nVersion: 1.0\n")
    lines = [f"toy {name} = pellicle_pigments:{name}" for name in NAMES[:-1]]
    lines.append("SiO2 = pellicle_pigments:glaze")
    (about / "entry_points.txt").write_text("\n".join(["[pellicle.materials]", *lines, ""]))
    (tmp_path / "pellicle_pigments.py").write_text(TOY)
    (tmp_path / "ochre.csv").write_text(
        "wavelength_nm,n,k\n" + "".join(f"{nm},2.6,0.2\n" for nm in range(400, 801, 50))
    )
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    yield tmp_path
    sys.modules.pop("pellicle_pigments", None)


def test_a_dispersion_a_function_and_a_file(installed):
    assert complex(material("toy glaze").index(550.0)) == 1.7
    assert complex(pl.medium("toy varnish").index(550.0)) == 1.5
    ochre = material("toy ochre")
    np.testing.assert_allclose(complex(ochre.index(550.0)), 2.6 + 0.2j)
    assert (ochre.name, ochre.wavelength_range) == ("toy ochre", (400.0, 800.0))
    assert complex(material("SiO2").index(550.0)) != 1.7  # the catalogue comes first


@pytest.mark.parametrize(
    ("name", "words"), [("broken", "fails to load"), ("wrong", "neither a dispersion nor a path")]
)
def test_errors_name_the_package(installed, name, words):
    with pytest.raises(DataError, match=f"material 'toy {name}' .*{words}"):
        material(f"toy {name}")
