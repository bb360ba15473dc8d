"""Tables, text and figures of a birefringent layer, from a fit written down by hand."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pellicle as pl
from pellicle.fitting.curves import Index
from pellicle.fitting.reported_layer import principal_indices
from pellicle.materials import material
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.figures import of_index
from pellicle.reporting.fit_tables import nk_csvs
from pellicle.reporting.fit_text import report

NM = np.linspace(400.0, 800.0, 41)


def index(n, error):
    rising = n + 1e-4 * (NM - 400.0)
    return Index(NM, rising, np.zeros(41), np.full(41, error), np.zeros(41))


@pytest.fixture
def birefringent(fit, with_part):
    """n_o is 1.33, n_e 1.48."""
    flat = Index(NM, np.linspace(0.15, 0.19, 41), np.zeros(41), np.full(41, 0.004), np.zeros(41))
    principal = {"ordinary": index(1.33, 0.001), "extraordinary": index(1.48, 0.003), "birefringence": flat}
    curve = dataclasses.replace(fit.curve, k_stderr=np.zeros(41), principal=principal)
    return with_part(fit, curve=curve)


def test_each_principal_index_is_a_material(birefringent, tmp_path, write):
    tables = nk_csvs(birefringent)
    assert list(tables) == ["nk_ordinary.csv", "nk_extraordinary.csv"]
    for name, n in (("nk_ordinary.csv", 1.33), ("nk_extraordinary.csv", 1.48)):
        path = write(tables[name], name)
        np.testing.assert_allclose(np.real(material(str(path))(NM)), n + 1e-4 * (NM - 400.0), rtol=1e-9)
    frame = pd.read_csv(tmp_path / "nk_extraordinary.csv", comment="#")
    np.testing.assert_allclose(frame["birefringence"], np.linspace(0.15, 0.19, 41))
    np.testing.assert_allclose(frame["birefringence_stderr"], 0.004)


def test_report_states_the_birefringence_with_its_error(birefringent, fit):
    text = report(birefringent)
    for line in ("400 nm  0.15000 ± 0.004", "600 nm  0.17000 ± 0.004", "800 nm  0.19000 ± 0.004"):
        assert line in text
    assert "Birefringence" not in report(fit)


def test_figures_show_each_index_with_its_band(birefringent):
    axes = [a for a in draw(birefringent).axes if a.get_ylabel() == "n"]
    assert [line.get_label() for line in axes[0].lines] == ["ordinary", "extraordinary"]
    assert axes[0].lines[1].get_ydata()[0] == pytest.approx(1.48)
    figure = of_index(birefringent)
    assert figure is not None
    assert "extraordinary" in str(figure)
    assert "birefringence" in str(figure)


def test_birefringence_has_the_error_of_a_difference():
    """Variances of both indices less twice their covariance; slopes are those of n_o, n_e in themselves."""
    free = [pl.dispersion.Constant(pl.Free(1.4, 1.9)) for _ in range(2)]
    scene = pl.Scene(pl.Layer(pl.Anisotropic(*free), 100.0), 1.5)
    slope = np.zeros((4, 3, 2))
    slope[0, :, 0] = slope[2, :, 1] = 1.0
    values = np.array([[1.5] * 3, [0.0] * 3, [1.7] * 3, [0.0] * 3])
    at = SimpleNamespace(layer=values, layer_slope=slope)
    covariance = np.array([[4.0, 3.0], [3.0, 9.0]]) * 1e-6
    found = principal_indices(scene, at, covariance, NM[:3])
    np.testing.assert_allclose(found["extraordinary"].n_stderr, 0.003)
    np.testing.assert_allclose(found["birefringence"].n, 0.2)
    np.testing.assert_allclose(found["birefringence"].n_stderr, np.sqrt(4 + 9 - 6) * 1e-3)
    isotropic = pl.Scene(pl.Layer(free[0], 100.0), 1.5)
    assert principal_indices(isotropic, at, covariance, NM[:3]) == {}
