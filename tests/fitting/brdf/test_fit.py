"""Whole fits: a surface that is known, one that has no layer, and samples that cannot be fitted."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.brdf import direction, model
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.errors import DataError, UsageError
from pellicle.fitting.brdf import evidence
from pellicle.fitting.brdf.fit import fit_brdf, fitted
from pellicle.fitting.result import Status
from pellicle.fitting.spectra.search import quiet
from pellicle.reporting.json_record import to_json
from pellicle.sampling import brdf
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

TRUTH = {
    "thickness": 320.0,
    "n": (1.48, 1.5, 1.53),
    "exponent_reflection": 60.0,
    "exponent_transmission": 25.0,
    "deviation": 0.0,
    "azimuth": 0.0,
    "specular": 1.5,
    "diffuse": 0.1,
}
FREE = Surface(
    "granier-heidrich",
    {
        "thickness": Free(0, 1000),
        "n": (1.48, 1.5, 1.53),
        "exponent_reflection": Free(1, 1000),
        "exponent_transmission": Free(1, 1000),
        "specular": Free(0, 100),
        "diffuse": Free(0, 2),
    },
)
FOUND = ("thickness", "exponent_reflection", "exponent_transmission", "specular", "diffuse")


def arcs(values, sigma):
    """40 directions in the plane of incidence at each of five incidences, as a goniometer takes them."""
    theta_o = np.tile(np.linspace(-78, 78, 40), 5)
    return BrdfSamples(
        np.repeat([10.0, 25, 40, 55, 70], 40),
        np.zeros(200),
        np.abs(theta_o),
        np.where(theta_o > 0, 180.0, 0.0),
        values,
        ("R", "G", "B"),
        sigma=sigma,
    )


def noisy(rho, seed):
    sigma = 0.01 * rho
    return arcs(np.abs(rho + sigma * np.random.default_rng(seed).standard_normal(rho.shape)), sigma)


@pytest.fixture(scope="module")
def found():
    """A fit of samples of the truth, and what it rests on."""
    empty = arcs(np.ones((200, 3)), None)
    i, o = direction(empty.theta_i, empty.phi_i), direction(empty.theta_o, empty.phi_o)
    rho = np.asarray(jax.jit(lambda: model("granier-heidrich")(TRUTH, i, o))())
    return fitted(noisy(rho, seed=3), FREE, None, quiet)


@pytest.fixture(scope="module")
def known(found):
    return found[0]


def test_a_known_surface_is_found_within_its_errors(known):
    assert known.status is Status.CONVERGED
    assert known.layered
    assert known.verdict.startswith("The samples call for a layer: thickness 320")
    for name in FOUND:
        p = known[name]
        assert abs(p.value - TRUTH[name]) < 4 * p.stderr < 0.1 * p.value
    assert known.chi2_reduced == pytest.approx(1, abs=0.25)
    assert all(known.held_out < 0.5 * b.held_out for b in known.baselines)
    told = " ".join(known.warnings)
    assert "specular is a weight and no albedo" in told
    assert "95 %" not in told
    assert all((p.lower_limit, p.upper_limit) == (None, None) for p in known.free)


def test_errors_are_those_of_the_inverse_hessian(known):
    """Σ = (JᵀJ)⁻¹ with J by finite differences of the model itself."""
    s = known.samples
    i, o = direction(s.theta_i, s.phi_i), direction(s.theta_o, s.phi_o)
    best = {**TRUTH, **{name: known[name].value for name in FOUND}}
    rho = jax.jit(lambda p: model("granier-heidrich")({**TRUTH, **p}, i, o))

    def slope(name):
        step = 1e-5 * best[name]
        up, down = (rho({f: best[f] + sign * step * (f == name) for f in FOUND}) for sign in (1, -1))
        return np.ravel((up - down) / (2 * step) / s.sigma)

    jacobian = np.stack([slope(name) for name in FOUND], axis=1)
    expected = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    length = 600 / known.effective_points
    np.testing.assert_allclose([known[name].stderr for name in FOUND], expected * np.sqrt(length), rtol=1e-4)


def test_a_lambertian_surface_has_no_layer():
    found = fit_brdf(noisy(np.full((200, 3), 0.2), seed=0), FREE)
    assert not found.layered
    assert found.verdict.startswith("No evidence of a layer: ")
    assert found.status is Status.NOT_IDENTIFIABLE
    assert found["thickness"].stderr == np.inf


def test_one_colour_for_all_directions_decides_nothing():
    """The layered diffuse part has three numbers for a thickness, three indices and a weight."""
    free = {"thickness": Free(0, 1000), "n": Free(1.05, 2.5)}
    surface = Surface("granier-heidrich-diffuse", free | {"diffuse": Free(0, 2)})
    found = fit_brdf(noisy(np.broadcast_to([0.3, 0.2, 0.25], (200, 3)), seed=1), surface)
    assert found.status is Status.NOT_IDENTIFIABLE
    assert found.verdict.endswith("the thickness has no finite error.")
    assert {p.stderr for p in found.free} == {np.inf}
    assert "thickness may be anything between 0 and 1000 nm" in found.warnings
    assert any("trade against each other" in sentence for sentence in found.warnings)
    record = to_json(found)
    assert record["parameters"]["n_g"]["stderr"] is None
    assert record["noise"] == {"sigma": pytest.approx(0.0025), "source": "given"}


def test_what_cannot_be_fitted_is_refused_in_words():
    flat = noisy(np.full((200, 3), 0.2), seed=0)
    with pytest.raises(UsageError, match="nothing is free"):
        fit_brdf(flat, Surface("granier-heidrich", {}))
    with pytest.raises(UsageError, match=r"3 channels .* for 1 wavelengths"):
        fit_brdf(flat, dataclasses.replace(FREE, wavelengths=(550.0,), numbers={**FREE.numbers, "n": 1.5}))
    with pytest.raises(UsageError, match="residual must be one of linear, cosine, log, cube-root"):
        fit_brdf(flat, FREE, residual="cubic")
    with pytest.raises(UsageError, match="5 samples are too few"):
        fit_brdf(flat.at(np.arange(5)), FREE)


@pytest.fixture
def fitted_before(monkeypatch, found):
    """Posteriors of the samples that were fitted, without another fit."""
    monkeypatch.setattr(brdf, "fitted", lambda *asked: found)


def test_a_posterior_is_as_wide_as_the_errors_say(fitted_before, known, tmp_path):
    """Every number is decided and far from its bounds: the posterior is normal."""
    drawn = pl.sample(known.samples, FREE, chain=tmp_path / "chain.h5")
    assert drawn.trusted
    assert list(drawn.parameters) == [p.name for p in known.free]
    for name in FOUND:
        at, p = drawn[name], known[name]
        assert at.sd == pytest.approx(p.stderr, rel=0.15)
        assert at.mean == pytest.approx(p.value, abs=0.2 * p.stderr)
        assert at.q975 - at.q025 == pytest.approx(2 * 1.96 * p.stderr, rel=0.15)
    assert str(drawn).startswith("With 95 % probability thickness lies between 3")
    for c, band in enumerate(drawn.predictions()):
        np.testing.assert_array_equal(band.data, known.samples.values[:, c])
        low, high = np.quantile(band.noisy, [0.025, 0.975], axis=0)
        assert 0.88 <= np.mean((band.data >= low) & (band.data <= high)) <= 0.995
        assert np.all(np.diff(np.median(band.model, axis=0)[np.argsort(band.axis.values)]) > -1e-3)


def test_a_chain_goes_on_and_belongs_to_its_problem(fitted_before, known, tmp_path):
    path = tmp_path / "chain.h5"
    assert not pl.sample(known.samples, FREE, chain=path, steps=20).trusted
    resumed = pl.sample(known.samples, FREE, chain=path, steps=40)
    whole = pl.sample(known.samples, FREE, steps=40)
    np.testing.assert_array_equal(resumed.draws, whole.draws)
    assert resumed.checks.steps == 40
    for other, changed in (
        (dataclasses.replace(known.samples, values=1.01 * known.samples.values), {}),
        (known.samples, {"thickness": Free(0, 900)}),
    ):
        surface = dataclasses.replace(FREE, numbers={**FREE.numbers, **changed})
        with pytest.raises(DataError, match="is the chain of another problem"):
            pl.sample(other, surface, chain=path)


def test_a_prior_narrows_a_posterior_and_not_the_fit(fitted_before, known):
    """Two independent measurements of one number: their inverse variances add."""
    p = known["specular"]
    prior = pl.priors.Normal(p.value, p.stderr)
    free = {**FREE.numbers, "specular": Free(0, 100, prior=prior)}
    drawn = pl.sample(known.samples, dataclasses.replace(FREE, numbers=free))
    assert drawn["specular"].sd == pytest.approx(p.stderr / np.sqrt(2), rel=0.12)
    told = evidence.priors(dataclasses.replace(FREE, numbers=free))
    assert told == ["the prior of specular counts in a posterior only: a fit of a surface takes none"]


def test_samples_that_are_alike_count_as_fewer(monkeypatch, found, known):
    """Four of a kind leave a posterior that is twice as wide."""
    fit, rest = found
    wider = rest._replace(at=rest.at._replace(variance=4 * rest.at.variance))
    monkeypatch.setattr(brdf, "fitted", lambda *asked: (fit, wider))
    drawn = pl.sample(known.samples, FREE)
    assert drawn["specular"].sd == pytest.approx(2 * known["specular"].stderr, rel=0.15)


def test_a_posterior_grants_the_layer_that_the_fit_does_not_see(found, known):
    fit, rest = found
    assert brdf._subject(known.samples, FREE, fit, rest).assumption == ""
    blind = dataclasses.replace(fit, layered=False, status=Status.NOT_IDENTIFIABLE)
    assert brdf._subject(known.samples, FREE, blind, rest).assumption == "there is a layer"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["granier-heidrich", "microfacet-film"])
def test_ptfe_has_no_layer(shared_data, name):
    """Sintered PTFE, measured by NIST: a white diffuser without any film, that interference fits well."""
    ptfe = pl.read_brdf_samples(shared_data / "brdf" / "nist_ptfe_633_532.csv")
    free = {"thickness": Free(0, 1000), "n": Free(1.05, 2.5)}
    free |= {"specular": Free(0, 100), "diffuse": Free(0, 2)}
    if name == "granier-heidrich":
        free |= {f"exponent_{side}": Free(1, 1000) for side in ("reflection", "transmission")}
    else:
        free["roughness"] = Free(0.003, 1)
    found = fit_brdf(ptfe, Surface(name, free, (633.0, 532.0, 532.0)))
    assert found.verdict.startswith("No evidence of a layer: ")
