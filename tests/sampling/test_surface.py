"""Posteriors of a surface: against the errors of a fit, of another problem, and of a tilt."""

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf import fit as fitting
from pellicle.fitting.progress import quiet
from pellicle.fitting.reweighting import RankedMinima
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from ..fitting.brdf.known_surface import BOUNDS, FREE, TRUTH, arcs, from_all_sides, noisy, search_from

EXACT = dataclasses.replace(FREE, uncertainty=pl.SurfaceUncertainty.none())
"""Without systematic effects, which a posterior takes to be normal and an error bounds at zero."""
UNITS = [0.32, *np.log([60, 25]) / np.log(1000), 0.015, 0.05]
"""The truth in the unit cube of the search."""


class Known(NamedTuple):
    samples: BrdfSamples
    fit: pl.Fit
    ranked: RankedMinima


@pytest.fixture(scope="module")
def known():
    """Samples of the truth with noise of 1 %, and a fit of them that starts at the truth."""
    samples = noisy(pl.simulate(Surface("granier-heidrich", TRUTH), directions=arcs()).values, 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "search", search_from(UNITS))
        return Known(samples, *fitting.fitted(samples, EXACT, 0.0, quiet))


@pytest.mark.slow  # fits and samples for 6 s; tests/sampling/test_sample.py samples a film
def test_a_posterior_is_as_wide_as_the_errors_say(monkeypatch, known, tmp_path):
    """Every number is determined and far from its bounds: the posterior is normal."""
    monkeypatch.setattr(fitting, "fitted", lambda *args, **options: (known.fit, known.ranked))
    posterior = pl.sample(known.samples, EXACT, chain=tmp_path / "chain.h5")
    assert posterior.trusted
    assert list(posterior.parameters) == [p.name for p in known.fit.free]
    for name in BOUNDS:
        marginal, p = posterior[name], known.fit[name]
        assert marginal.sd == pytest.approx(p.stderr, rel=0.15)
        assert marginal.mean == pytest.approx(p.value, abs=0.2 * p.stderr)
        assert marginal.q975 - marginal.q025 == pytest.approx(2 * 1.96 * p.stderr, rel=0.15)
    assert str(posterior).startswith("With 95 % probability thickness lies between 3")
    assert posterior.assumption == ""
    for channel, band in enumerate(posterior.predictions()):
        np.testing.assert_array_equal(band.data, known.samples.values[:, channel])
        low, high = np.quantile(band.noisy, [0.025, 0.975], axis=0)
        assert 0.88 <= np.mean((band.data >= low) & (band.data <= high)) <= 0.995
        assert np.all(np.diff(np.median(band.model, axis=0)[np.argsort(band.axis.values)]) > -1e-3)


@pytest.mark.slow  # samples; tests/sampling/test_checks.py is quick
def test_without_sigma_a_posterior_is_as_wide_as_the_errors_too(monkeypatch):
    """Under a noise in proportion to the signal, which one σ for all samples would state wrongly."""
    clean = pl.simulate(Surface("granier-heidrich", TRUTH), directions=arcs()).values
    noise = 1 + 0.03 * np.random.default_rng(8).standard_normal(clean.shape)
    monkeypatch.setattr(fitting, "search", search_from(UNITS))
    posterior = pl.sample(dataclasses.replace(arcs(), values=clean * noise), EXACT)
    assert posterior.trusted
    for name in BOUNDS:
        assert posterior[name].sd == pytest.approx(posterior.fit[name].stderr, rel=0.15), name
    [band, *_] = posterior.predictions()
    assert np.all(np.isfinite(band.model))


@pytest.mark.parametrize(
    ("status", "assumption"), [(pl.Status.NOT_IDENTIFIABLE, "there is a layer"), (pl.Status.AMBIGUOUS, "")]
)
def test_without_evidence_of_a_layer_a_posterior_assumes_one(monkeypatch, known, status, assumption):
    """But one of several thicknesses is a layer all the same."""
    layer_test = dataclasses.replace(known.fit.layer_test, layered=False)
    blind = dataclasses.replace(known.fit, layer_test=layer_test, status=status)
    monkeypatch.setattr(fitting, "fitted", lambda *args, **options: (blind, known.ranked))
    posterior = pl.sample(known.samples, EXACT, steps=20)
    assert posterior.assumption == assumption


@pytest.mark.slow
def test_an_azimuth_is_drawn_within_half_a_turn_of_the_best(monkeypatch):
    """Across the ends of its bounds, and all directions of the disc are as likely: with much noise."""
    tilted = Surface("granier-heidrich", {**TRUTH, "deviation": 3.0, "azimuth": 170.0})
    turned = pl.simulate(tilted, directions=from_all_sides(("R", "G", "B")), noise=0.4)
    free = {"deviation": Free(0, 20), "azimuth": Free(-180, 180)}
    monkeypatch.setattr(fitting, "search", search_from([0.43, 0.51]))
    posterior = pl.sample(turned, Surface("granier-heidrich", {**TRUTH, **free}), steps=300)
    best = posterior.fit["azimuth"].value
    azimuth = posterior.draws[..., posterior.names.index("azimuth")]
    assert abs(best) > 150
    assert np.abs(azimuth).max() > 185
    assert np.abs(azimuth - best).max() <= 180
