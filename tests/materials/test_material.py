"""The range check, published indices, and finding materials inside larger things."""

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

from pellicle.dispersion.empirical import Constant, Shifted
from pellicle.errors import DataError
from pellicle.materials import Material, material, materials_in
from pellicle.optics.pair import is_real


def test_inside_the_range_nothing_happens():
    material("Si").check_range(np.linspace(250, 1450, 11))
    material("Si").check_range(250)
    material("air").check_range([1, 1e8])
    material("Si").check_range([])


@pytest.mark.parametrize(
    ("name", "nm", "where", "remedy"),
    [
        ("Si/Aspnes", [900, 300, 850], "206.6 to 826.6 nm, not at 850 to 900 nm", "range=(300, 826.6)"),
        (
            "Si",  # wavelengths of a simulation are no data to cut
            [200, 500],
            "250 to 1450 nm, not at 200 nm",
            "keep to 250 to 500 nm, of data with `range=(250, 500)`",
        ),
        ("Si", [300, 2000], "250 to 1450 nm, not at 2000 nm", "range=(300, 1450)"),
        (
            "Si",
            [200, 500],
            "250 to 1450 nm, not at 200 nm",
            "use a page that covers them all (Si/Franta-25C)",
        ),
        ("Au", [50], "187.9 to 1937 nm, not at 50 nm", "use a file of n and k that covers them all, or"),
    ],
)
def test_outside_it_says_what_where_and_what_to_do(name, nm, where, remedy):
    with pytest.raises(ValueError, match=f"^{name} .* is known from {where}: .*{re.escape(remedy)}"):
        material(name).check_range(nm)


def test_both_parts_are_nan_outside_whatever_the_dispersion():
    source = Material(Constant(1.5, 0.1), "X", "a/X/b", "", (400.0, 500.0), True)
    value = source.index(np.array([399.0, 450.0, 501.0]))
    assert np.isnan(value.re).tolist() == np.isnan(value.im).tolist() == [True, False, True]


def test_a_wavelength_that_is_not_a_number_is_outside(refuses):
    refuses(ValueError, "not at nan nm", material("Si").check_range, [math.nan])


def test_materials_in_a_tree():
    gold = material("Au")
    tree = {"layer": [Shifted(gold, n=0.1), Constant(1.5), gold], "below": material("Si")}
    assert sorted(material.name for material in materials_in(tree)) == ["Au", "Si"]


def test_caution_comes_first():
    source = Material(Constant(1.5), "X", "a/X/b", "", (0.0, math.inf), False, caution="Look out.")
    assert source.warnings()[0] == "Look out."
    assert "no data for k" in source.warnings()[1]


def test_an_ambient_leaves_out_a_small_extinction():
    """Where it is small nowhere, or not known, nothing is left out."""
    water = material("H2O")
    ambient = water.as_ambient()
    assert is_real(ambient.index(np.array([550.0])))
    assert ambient.warnings() == ["H2O (main/H2O/Hale) is the ambient: its k, at most 1e-05, is left out."]
    assert [m.clear for m in materials_in((water, ambient))] == [False, True]
    ambient.check_range([300.0, 900.0])
    with pytest.raises(DataError, match=r"H2O has k = 0\.00012 at 1450 nm, and up to 1e-05 is left out"):
        ambient.check_range([900.0, 1450.0])
    for name in ("Au", "SiO2"):
        assert material(name).as_ambient() == material(name)


def test_another_form_of_a_material_is_no_remedy_for_its_range():
    with pytest.raises(DataError) as caught:  # the book of silica also has quartz, known from 198 nm
        material("SiO2").check_range([200, 500])
    assert "or use a file of n and k" in str(caught.value)
    with pytest.raises(DataError) as caught:  # alumina is known from 300 nm
        material("alumina").check_range([280, 500])
    assert "Malitson" not in str(caught.value)


ROWS = Path(__file__).with_name("published_indices.csv").read_text("utf-8").splitlines()
PUBLISHED = list(csv.DictReader(row for row in ROWS if not row.startswith("#")))


@pytest.mark.parametrize("row", PUBLISHED, ids=[row["page"] for row in PUBLISHED])
def test_an_index_agrees_with_a_published_one(row):
    nm, n, k, tolerance = (float(row[name]) for name in ("wavelength_nm", "n", "k", "tolerance"))
    assert abs(complex(material(row["page"])(nm)) - complex(n, k)) < tolerance, row["source"]


def test_galena_reflects_as_the_mineral():
    """42.1 % at 589 nm in air: Criddle and Stanley, Quantitative Data File for Ore Minerals."""
    n = complex(material("PbS")(589.0))
    assert abs((n - 1) / (n + 1)) ** 2 == pytest.approx(0.421, abs=0.015)
