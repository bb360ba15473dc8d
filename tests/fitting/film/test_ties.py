"""Fits with tied numbers: equal to the fit of the same scene without ties, and the examples of the docs."""

import json
from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.parameters import parameters
from pellicle.reporting.json_record import to_json

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples"


@pytest.mark.slow
def test_two_tied_halves_are_one_layer():
    """Values and errors are those of the whole layer, which has no tie; the index follows too."""
    known = {"uncertainty": pl.Uncertainty.none()}
    index = pl.dispersion.Constant(pl.Tied("upper.n"))
    halves = [
        pl.Layer(pl.Free(1.4, 1.6), pl.Free(150, 300), "upper"),
        pl.Layer(index, pl.Tied("2 * upper.thickness - upper.thickness"), "lower"),
    ]
    whole = pl.Scene(pl.Layer(pl.Free(1.4, 1.6), pl.Free(300, 600)), "Si", **known)
    true = pl.Scene(pl.Layer(1.46, 430.0), "Si")
    spectrum = pl.simulate(true, np.arange(450.0, 750.0, 5.0), noise=0.001)
    tied, plain = pl.fit(spectrum, pl.Scene(halves, "Si", **known)), pl.fit(spectrum, whole)
    upper, lower, own = tied["upper.thickness"], tied["lower.thickness"], plain["thickness"]
    assert [p.name for p in tied.free] == ["upper.thickness", "upper.n"]
    assert upper.value + lower.value == pytest.approx(own.value, rel=1e-5)
    for name in ("stderr", "stderr_noise"):
        assert 2 * getattr(lower, name) == pytest.approx(getattr(own, name), rel=0.01)
        assert getattr(tied["lower.n"], name) == pytest.approx(getattr(plain["n"], name), rel=0.01)
    assert abs(2 * lower.value - 430) < 4 * own.stderr
    record = to_json(tied)["parameters"]["lower.thickness"]
    assert (record["free"], record["tied"]) == (False, "2 * upper.thickness - upper.thickness")
    assert record["stderr"] == lower.stderr > 0
    assert "= 2 * upper.thickness - upper.thickness" in tied.report()
    json.dumps(to_json(tied), allow_nan=False)


def recovered(name):
    """Parameters of a fit of what the recipe of an example simulates; each free number within its errors."""
    recipe = pl.read_recipe(EXAMPLES / name)
    scene, grid = recipe.scene(), recipe.tables.data.wavelengths
    wavelength = np.arange(grid.start, grid.stop + grid.step / 2, 2 * grid.step)
    fit = pl.fit(pl.simulate(scene, wavelength, noise=0.002), scene)
    for p in parameters(scene):
        assert abs(fit[p.name].value - p.start) < 4 * fit[p.name].stderr, p.name
    return fit.parameters


def test_equal_surfactant_layers_of_a_soap_film():
    found = recovered("soap_film.toml")
    assert found["lower.thickness"].value == found["upper.thickness"].value
    assert found["lower.thickness"].stderr == pytest.approx(found["upper.thickness"].stderr)
    assert found["water.thickness"].stderr > 0


@pytest.mark.slow
def test_epilayer_with_the_lattice_of_its_substrate():
    found = recovered("epilayer.toml")
    assert found["term1.E0"].tied == "substrate.term1.E0"
    assert found["eps_inf"].stderr == pytest.approx(found["substrate.eps_inf"].stderr)


@pytest.mark.slow
def test_one_factor_for_the_layers_of_a_material():
    found = recovered("filter_stack.toml")
    ratio = found["high2.thickness"].stderr / found["high1.thickness"].stderr
    assert ratio == pytest.approx(61.0 / 58.5)
