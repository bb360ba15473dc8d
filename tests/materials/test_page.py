"""Reading pages: cleaning of tables, combination of n and k, what cannot be read."""

import numpy as np
import pytest

from pellicle.errors import DataError
from pellicle.materials.formats.optical_constants import table
from pellicle.materials.formats.refractiveindex_info import contents, load_yaml, plain_text, to_nm
from pellicle.optics.pair import imag, is_real, real


def page(*blocks):
    return {"DATA": list(blocks)}


FORMULA = {"type": "formula 5", "wavelength_range": "0.3 2", "coefficients": "1.5"}


def test_micrometres_become_round_nanometres():
    assert to_nm(0.2652) == 265.2
    assert to_nm([0.3072, 1.937]).tolist() == [307.2, 1937.0]


def test_points_are_sorted_and_repeated_ones_averaged():
    found = table([500, 400, 500], [1.4, 1.5, 1.6], [0.1, 0.2, 0.3])
    assert found.dispersion.wavelength.tolist() == [400, 500]
    np.testing.assert_allclose(found.dispersion.n, [1.5, 1.5])
    np.testing.assert_allclose(found.dispersion.k, [0.2, 0.2])


def test_negative_k_is_noise_or_left_out():
    found = table([400, 500, 600, 700], [1.5, 1.5, 1.5, 1.5], [0.1, -1e-6, 0.1, -0.05])
    assert found.dispersion.k.tolist() == [0.1, 0.0, 0.1]
    assert found.wavelength_range[1] == 600


def test_n_and_k_from_different_sources_are_known_where_both_are():
    both = contents(page(FORMULA, {"type": "tabulated k", "data": "0.25 0.1\n1.0 0.2\n"}))
    assert both.wavelength_range == (300.0, 1000.0)
    assert both.has_extinction
    value = both.dispersion.index(np.array([625.0]))
    assert real(value) == pytest.approx(1.5)
    assert imag(value) == pytest.approx(0.15)


def test_two_tables_with_their_own_points():
    index = {"type": "tabulated n", "data": "0.4 1.5\n0.6 1.7\n"}
    extinction = {"type": "tabulated k", "data": "0.45 0.1\n0.7 0.1\n"}
    both = contents(page(index, extinction))
    assert both.wavelength_range == (450.0, 600.0)
    assert real(both.dispersion.index(500.0)) == pytest.approx(1.6)


def test_zero_k_beside_a_formula_is_transparent_but_known():
    found = contents(page(FORMULA, {"type": "tabulated k", "data": "0.25 0\n1.0 0\n"}))
    assert found.has_extinction
    assert is_real(found.dispersion.index(500.0))


@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        ([{"type": "tabulated k", "data": "0.4 0.1\n0.5 0.1\n"}], "k without n"),
        ([{"type": "formula A", "coefficients": "1"}], "formula A"),
        ([FORMULA, {"type": "tabulated k", "data": "3.0 0.1\n4.0 0.1\n"}], "do not overlap"),
    ],
)
def test_what_is_no_index_is_refused(blocks, words, refuses):
    refuses(DataError, words, contents, page(*blocks))


def test_yaml():
    assert load_yaml("DATA:\n  - type: x\n") == page({"type": "x"})


TITLE = "P. B. Johnson and R. W. Christy. Optical constants of the noble metals."
REFERENCE = (
    'P. B. Johnson and R. W. Christy.\nOptical constants of the noble metals.\n<a href="https://doi.org/10.1/x">'
    "<i>Phys. Rev. B</i> <b>6</b>, 4370&ndash;4379 (1972)</a><br>\n"
    '[<a href="https://a.b/c">Calculation script</a>]'
)


@pytest.mark.parametrize(
    ("markup", "text"),
    [
        (REFERENCE, f"{TITLE} Phys. Rev. B 6, 4370–4379 (1972) https://doi.org/10.1/x"),
        ('<a href="https://a.b/c">data sheet</a>, 2017', "data sheet, 2017"),
        ("Orientation: <111>; H<sub>2</sub>O", "Orientation: <111>; H2O"),
        (None, ""),
    ],
)
def test_plain_text_has_dois_and_no_tags(markup, text):
    assert plain_text(markup) == text
