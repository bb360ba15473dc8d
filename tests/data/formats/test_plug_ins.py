"""A reader of another package, found by its entry point."""

import sys

import numpy as np
import pytest

from pellicle.data.formats import plug_ins
from pellicle.data.read_spectrum import read_spectra, read_spectrum

TOY = """
import numpy as np

class Reader:
    def detect(self, content):
        return content.startswith(b"TOY")

    def read(self, content):
        if content == b"TOY broken":
            raise KeyError("no table")
        if content == b"TOY ragged":
            return {"": {"wavelength (nm)": [1.0, 2.0], "R (%)": [3.0]}}
        nm = np.arange(500.0, 400.0, -10.0)
        levels = {"a": 20, "b": 30}
        return {name: {"wavelength (nm)": nm, "R (%)": x + 0 * nm} for name, x in levels.items()}
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The toy package, as an installer leaves it."""
    about = tmp_path / "pellicle_toy-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: pellicle-toy\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[pellicle.readers]\ntoy = pellicle_toy:Reader\n")
    (tmp_path / "pellicle_toy.py").write_text(TOY)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    plug_ins.plug_ins.cache_clear()
    yield tmp_path
    plug_ins.plug_ins.cache_clear()
    sys.modules.pop("pellicle_toy", None)


def test_a_reader_of_another_package(installed, write, tmp_path):
    path = tmp_path / "film.toy"
    path.write_bytes(b"TOY 1")
    first, second = read_spectra(path, spectrum="all")
    assert (first.name, second.name) == ("a", "b")
    np.testing.assert_allclose(first.wavelength, np.arange(410.0, 501.0, 10.0))
    np.testing.assert_allclose(second.values, 0.3)
    assert "read by toy" in first.notes
    assert len(read_spectrum(write("wavelength_nm,R\n400,0.1\n410,0.2\n420,0.3\n430,0.2\n440,0.1\n"))) == 5


@pytest.mark.parametrize(("content", "words"), [("TOY broken", "no table"), ("TOY ragged", "shapes")])
def test_its_errors_name_it(installed, write, refused, content, words):
    refused(content, "reader 'toy' of another package fails", words)


def test_one_that_does_not_load(installed, write, refused):
    (installed / "pellicle_toy.py").write_text("import nothing_of_this_name\n")
    refused("wavelength_nm,R\n400,0.1\n", "reader 'toy'", "fails to load", "uninstall that package")
