"""A signal of one column that a class alone defines: nothing else knows its word."""

from typing import ClassVar

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.registry import Comparison
from pellicle.reporting.cost import error_label
from pellicle.reporting.data_panels import measured
from pellicle.reporting.measured_text import describe
from pellicle.signals.one_column import OneColumn
from pellicle.signals.registry import KINDS, SIMULATED, kind
from pellicle.signals.sphere import psi_delta

NM = np.linspace(450.0, 750.0, 16)


class Loss(OneColumn):
    """What is not reflected."""

    word: ClassVar[str] = "loss"
    title: ClassVar[str] = "loss 1 - R"
    noun: ClassVar[str] = "loss"
    simulated: ClassVar[str] = "R"
    ordinate: ClassVar[str] = "loss"

    def of_power(self, power):
        return 1 - power

    def check_values(self, values, sigma, where, too_high, remedy): ...


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    monkeypatch.setitem(KINDS, "loss", Loss)
    for name in ("scene.film.SIMULATED", "data.spectrum.SIGNALS"):  # of a registry without it
        monkeypatch.setattr(f"pellicle.{name}", (*SIMULATED, "loss"))


def test_values_text_and_figure():
    layers = pl.Layer(1.46, 210.0), 3.9 + 0.02j
    data = pl.simulate(pl.Scene(*layers, light=pl.Light(signal="loss")), NM)
    np.testing.assert_allclose(data.values, 1 - pl.simulate(pl.Scene(*layers), NM).values, atol=1e-12)
    assert "loss 1 - R, unpolarised light" in describe(data)
    [[panel]] = measured(data).rows
    assert panel.label == "loss"


@pytest.mark.parametrize(
    ("word", "label"),
    [("R", "R"), ("mueller", "Mueller elements"), ("contrast", "contrast"), ("loss", "loss")],
)
def test_unit_of_errors(word, label):
    assert error_label(Comparison("forward", unit=word)) == f"error in {label}"


@pytest.mark.parametrize("depolarisation", [False, True])
def test_quantities_of_columns(depolarisation):
    """Ψ and Δ of each ratio in turn, the depolarisation last; other columns as they are."""
    columns = np.random.default_rng(0).normal(size=(4, 7, 6))
    psi, delta = psi_delta(columns.reshape(4, 7, 2, 3))
    ratios = kind("generalised-psi-delta", parts=("ane", "asp")).in_quantities(columns)
    both = [psi[..., 0], delta[..., 0], psi[..., 1], delta[..., 1]]
    np.testing.assert_array_equal(ratios, np.stack(both, -1))
    one = kind("psi-delta", depolarisation=depolarisation).in_quantities(columns[..., : 3 + depolarisation])
    np.testing.assert_array_equal(one[..., :2], ratios[..., :2])
    np.testing.assert_array_equal(one[..., 2:], columns[..., 3 : 3 + depolarisation])
    np.testing.assert_array_equal(kind("contrast").in_quantities(columns[..., :1]), columns[..., :1])
