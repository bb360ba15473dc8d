"""Media at other temperatures: the catalogue of Schott, interpolation, limits, recipes."""

import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
import pellicle.dispersion as d
from pellicle.dispersion.base import known_index
from pellicle.errors import UsageError
from pellicle.optics.pair import real
from pellicle.recipes import media, medium_schema
from pellicle.recipes.written_media import same, written_medium

BK7 = {"D0": 1.86e-6, "D1": 1.31e-8, "D2": -1.37e-11, "E0": 4.34e-7, "E1": 6.27e-10, "lambda_TK": 0.170}
"""Data sheet of Schott N-BK7 (517642.251)."""


@pytest.mark.parametrize(
    ("temperature", "reference", "slopes"),
    # its "Δn_abs/ΔT in 1e-6/K" at 1060.0, 546.1 and 435.8 nm, rounded to 0.1
    [(40.0, 20.0, (1.1, 1.6, 2.1)), (80.0, 60.0, (1.5, 2.1, 2.7))],
)
def test_catalogue_of_schott(temperature, reference, slopes):
    nm = np.array([1060.0, 546.1, 435.8])
    glass = pl.material("BK7")
    ends = [real(known_index(d.ThermoOptic(glass, t, **BK7), nm)) for t in (reference, temperature)]
    found = (ends[1] - ends[0]) / (temperature - reference) * 1e6
    np.testing.assert_allclose(found, slopes, atol=0.051)


def test_constant_slope_and_k_unchanged():
    film = d.ThermoOptic(d.Constant(1.5, 0.02), 120.0, 20.0, dn_dT=-1e-4)
    index = known_index(film, np.array([500.0]))
    assert (float(index.re[0]), float(index.im[0])) == pytest.approx((1.49, 0.02))


def test_between_tables():
    """Linear in temperature, the media themselves at their temperatures, NaN beyond."""
    tables = [d.Table([400.0, 800.0], [1.5, 1.4], [0.1, 0.0]), d.Constant(1.7), d.Constant(2.0, 0.3)]
    at = lambda t: complex(d.AtTemperature((0, 100, 300), tables, np.float64(t))(600.0))  # noqa: E731
    assert at(0) == pytest.approx(1.45 + 0.05j)
    assert at(50) == pytest.approx(1.575 + 0.025j)
    assert at(200) == pytest.approx(1.85 + 0.15j)
    assert at(300) == pytest.approx(2.0 + 0.3j)
    beyond = d.AtTemperature((0, 100, 300), tables, jnp.asarray(301.0))
    assert np.isnan(complex(beyond(600.0)))


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (
            {"model": "at-temperature", "media": [1.4], "temperatures": [20, 30], "temperature": 25},
            "2 need as many",
        ),
        (
            {"model": "at-temperature", "media": [1.4, 1.5], "temperatures": [20, 30], "temperature": 35},
            "must lie in 20 to 30",
        ),
        (
            {"model": "at-temperature", "media": 1.4, "temperatures": [20, 30], "temperature": 25},
            "must be lists",
        ),
        ({"model": "thermo-optic", "temperature": 25}, "needs base"),
        ({"model": "thermo-optic", "base": "BK7", "temperature": 25, "D3": 1}, "did you mean 'D"),
    ],
)
def test_recipes_that_cannot_be(table, said, refuses):
    refuses(UsageError, said, media.medium, medium_schema.MediumTable(**table))


@pytest.mark.parametrize(
    "table",
    [
        {"model": "thermo-optic", "base": "BK7", "temperature": {"lower": 0, "upper": 90}, **BK7},
        {"model": "at-temperature", "media": ["SiO2", 1.5], "temperatures": [20, 30], "temperature": 25},
        {
            "model": "gervais",
            "eps_inf": 3.0,
            "TO1": 0.05,
            "LO1": 0.06,
            "TO2": 0.07,
            "LO2": {"lower": 0.08, "upper": 0.1},
        },
        {"model": "new-amorphous", "f1": {"lower": 0, "upper": 1}, "f2": 0.1, "E2": 7.0},
        {"model": "psemi", "A": 4.0, "WL": 0.5},
        {"model": "oscillators", "terms": [{"kind": "uv-pole", "A": 40.0}, {"kind": "tanguy", "Eg": 3.3}]},
    ],
)
def test_recipes_written_and_read(table, tmp_path):
    medium = media.medium(medium_schema.MediumTable(**table))
    again = media.medium(medium_schema.MediumTable(**written_medium(medium, "material", tmp_path)))
    assert same(medium, again)
