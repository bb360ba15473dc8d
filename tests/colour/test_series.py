"""Colours of published series, computed by tmm and colour-science or named, against their thicknesses."""

from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import FilmColourTable, invert


@pytest.fixture(scope="module")
def benchmark(modules_of):
    with modules_of(Path(__file__).parents[2] / "benchmarks", "colour_series") as modules:
        yield modules["colour_series"]


@pytest.fixture(scope="module")
def oxide():
    return FilmColourTable.build(pl.material("SiO2"), pl.material("Si"), (0, 1000), angle=(0, 5))


def test_the_chart_of_oxide_on_silicon_is_read_back_within_3_nm(benchmark, oxide):
    """Every fourth colour up to 900 nm, by another program and to 8 bits."""
    truth = np.array([row.thickness for row in benchmark.series("oxide")])[:46:4]
    found = invert(oxide, benchmark.by_tmm(truth, pl.material("SiO2"), pl.material("Si")))
    off = np.abs(found.thickness - truth[:, None])
    assert np.sum(np.any(off <= 3.0, axis=1)) >= len(truth) - 1  # 8 bits do not resolve 3 nm near 900 nm
    assert not np.any((off[:, 0] > 3.0) & (found.status == "converged"))


def test_the_heat_tints_of_steel_are_read_back_within_3_nm(benchmark):
    truth = np.array([row.thickness for row in benchmark.series("temper")])
    film = FilmColourTable.build(2.9, pl.material("Fe"), (0, 150), angle=(0, 5))
    found = invert(film, benchmark.by_tmm(truth, 2.9, pl.material("Fe")))
    np.testing.assert_allclose(found.thickness[:, 0], truth, atol=3.0)


def test_the_names_of_the_chart_are_the_hues_of_their_thicknesses(benchmark, oxide):
    """As the eye adapted to the wafer names them, up to 520 nm."""
    rows = benchmark.series("oxide")[:27]
    thickness = np.arange(1.0, 600.0)
    off = benchmark.misses(rows, thickness, benchmark.hues(oxide, thickness, bare=True))
    assert np.mean(np.diag(off) <= 3.0) > 0.8
    assert np.mean(off <= 3.0) < 0.3  # names dealt to wrong rows do not agree


def test_every_name_has_a_place_on_the_hue_circle(benchmark):
    for row in (*benchmark.series("oxide"), *benchmark.series("temper")):
        assert np.any(benchmark.agrees(np.arange(400.0), row.name)), row
    assert benchmark.agrees(np.array([10.0, 330.0]), "red violet").tolist() == [False, False]
    assert benchmark.agrees(np.array([380.0, 75.0]), "orange to melon").tolist() == [False, True]
