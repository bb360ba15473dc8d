"""The catalogue as text and as a figure."""

import pytest

from pellicle.errors import UsageError
from pellicle.materials import UnknownMaterial, names, pages
from pellicle.reporting.materials import describe, figure, table


def test_the_table_lists_every_name_and_every_page():
    text = table()
    lines = text.splitlines()
    unnamed = {*pages()} - {entry.page for entry in names()}
    assert len(lines) == 1 + len(names()) + len(unnamed)
    assert "SiO2                      main/SiO2/Malitson" in text
    [line] = [line for line in lines if line.startswith("HgS ")]
    assert line.endswith("model, not measured")


def test_a_family_has_its_materials_and_no_other():
    names = [line.split()[0] for line in table("sulfide").splitlines()]
    assert {"HgS", "ZnS"} <= {*names}
    assert not {"SiO2", "Au", "Fe2O3"} & {*names}


def test_a_description_gives_page_reason_citation_and_the_other_pages():
    text = describe("gold")
    for words in ("main/Au/Johnson", "187.9-1937 nm", "Phys. Rev. B", "Au/Rosenblatt-11nm", "taken as bulk"):
        assert words in text
    assert "model, not measured" in describe("HgS")
    assert "taken as transparent" in describe("SiO2")
    assert "all wavelengths" in describe("air")
    assert "Malitson" in describe("main/SiO2/Malitson")  # the full name of a page is no file
    with pytest.raises(UnknownMaterial):
        describe("unobtainium")


def test_a_file_is_described_as_it_was_understood(write):
    path = write("Silicon of 1992\nmicrons\nNK\n0.5 4.4 0.05\n0.7 3.8 0.01\n", "si.mat")
    text = describe(str(path))
    for words in (
        "WVASE",
        "wavelength in um, n, k; 2 rows",
        "500-700 nm",
        "Silicon of 1992",
        "n = 4.1321, k = 0.03214 at 589.3 nm",
    ):
        assert words in text
    path = write("500 4.3 0.05\n700 3.8 0.01\n", "si.txt")
    assert "read as nm" in describe(str(path))


@pytest.mark.parametrize(("name", "suffix"), [("HgS", ".png"), ("CuO/Brimhall", ".svg")])
def test_a_figure_is_written_whole_and_alone(tmp_path, name, suffix):
    path = figure(name, tmp_path / f"nk{suffix}")
    assert path.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["nk", "nk.doc", "missing/nk.png"])
def test_a_figure_that_cannot_be_written_leaves_nothing(tmp_path, name, refuses):
    refuses(UsageError, "`path`", figure, "Au", tmp_path / name)
    assert list(tmp_path.iterdir()) == []
