"""Whole fits: a surface that is known, surfaces without a layer, and samples that cannot be fitted."""

import dataclasses

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.api.fits import fit
from pellicle.brdf import direction, model
from pellicle.errors import DataError, UsageError
from pellicle.fitting.brdf import fit as module
from pellicle.fitting.result import Status
from pellicle.reporting.json_record import to_json
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from ...differences import jacobian
from .known_surface import BOUNDS, FREE, TRUTH, arcs, noisy, search_from

NAMES = tuple(BOUNDS)


START = [0.32, *(np.log(x) / np.log(1000) for x in (60, 25)), 0.015, 0.05]
"""The truth in the unit cube."""


@pytest.fixture(scope="module")
def samples():
    """Samples of the truth."""
    empty = arcs()
    i, o = direction(empty.theta_i, empty.phi_i), direction(empty.theta_o, empty.phi_o)
    return noisy(np.asarray(jax.jit(lambda: model("granier-heidrich")(TRUTH, i, o))()), seed=3)


@pytest.fixture(scope="module")
def known(samples):
    """A fit of them that starts at the truth: the programs of a search compile for 10 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "search", search_from(START))
        return fit(samples, FREE)


@pytest.mark.slow
def test_a_known_surface_is_found_within_its_errors(samples):
    known = fit(samples, FREE)
    assert known.status is Status.CONVERGED
    assert known.layer_test.layered
    assert known.verdict.startswith("Evidence of a layer: thickness 320")
    for name in NAMES:
        p = known[name]
        assert abs(p.value - TRUTH[name]) < 4 * p.stderr < 0.1 * p.value
    assert known.chi2_reduced == pytest.approx(1, abs=0.25)
    assert all(known.layer_test.held_out < 0.5 * b.held_out for b in known.layer_test.baselines)
    messages = " ".join(known.warnings)
    assert "specular is a weight and no albedo" in messages
    assert "95 %" not in messages
    assert all((p.lower_limit, p.upper_limit) == (None, None) for p in known.free)


@pytest.mark.slow
def test_the_record_of_a_fit(known):
    """A single set of samples has no name; residuals are in standard deviations where σ is known."""
    [part] = known.parts
    assert (part.name, known.joint, part.sigma_from) == ("", False, "given")
    assert known.samples is part.samples is part.data
    assert known.surface is FREE
    assert known.layer_test.residual == "linear"
    assert [b.name for b in known.layer_test.baselines] == [
        *("the surface without interference", "two lobes without a layer")
    ]
    np.testing.assert_array_equal(known.model, part.curve.model)
    residual = (known.samples.values - known.model) / known.samples.sigma
    np.testing.assert_allclose(part.curve.residual, residual, atol=1e-9)
    np.testing.assert_allclose([known.rms, part.rms], np.sqrt(np.mean(residual**2)))
    assert known.chi2_reduced == pytest.approx(np.sum(residual**2) / (600 - 5))
    assert known.profile is None
    with pytest.raises(TypeError, match="BRDF samples were fitted"):
        known.spectrum  # noqa: B018


def test_errors_are_those_of_the_inverse_hessian(known):
    """Σ = (JᵀJ)⁻¹ with J by finite differences of the model itself."""
    s = known.samples
    i, o = direction(s.theta_i, s.phi_i), direction(s.theta_o, s.phi_o)
    best = np.array([known[name].value for name in NAMES])
    rho = jax.jit(lambda x: model("granier-heidrich")({**TRUTH, **dict(zip(NAMES, x, strict=True))}, i, o))
    slopes = (jacobian(rho, best, 1e-5 * best) / s.sigma[..., None]).reshape(-1, len(NAMES))
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    length = 600 / known.effective_points
    found = [known[name].stderr_noise for name in NAMES]
    np.testing.assert_allclose(found, expected * np.sqrt(length), rtol=1e-4)


def test_the_budget_is_what_other_numbers_of_the_surface_would_give(known, monkeypatch):
    """The index of the film is fixed: with another one by its uncertainty the fit gives another thickness."""
    monkeypatch.setattr(module, "search", search_from(START))
    n, budget = np.asarray(FREE.numbers["n"]), {row.name: row for row in known.budget}
    assert {"index of the film", "gain of G", "wavelength of B", "viewing angle"} <= budget.keys()
    assert not {"index of the base", "extinction of the base"} & budget.keys()  # the model has no base
    other = dataclasses.replace(FREE, numbers={**FREE.numbers, "n": (1.005 * n).tolist()})
    moved = fit(known.samples, other)["thickness"].value - known["thickness"].value
    assert moved == pytest.approx(budget["index of the film"].changes["thickness"], rel=0.15)
    assert known["thickness"].stderr > 3 * known["thickness"].stderr_noise
    assert "(95 %; ±" in known.verdict


@pytest.mark.slow
def test_one_colour_in_all_directions_determines_nothing():
    """The layered diffuse part has three numbers for a thickness, three indices and a weight."""
    free = {"thickness": Free(0, 1000), "n": Free(1.05, 2.5)}
    surface = Surface("granier-heidrich-diffuse", free | {"diffuse": Free(0, 2)})
    result = fit(noisy(np.broadcast_to([0.3, 0.2, 0.25], (200, 3)), seed=1), surface)
    assert result.status is Status.NOT_IDENTIFIABLE
    assert result.verdict.endswith("the thickness has no finite error.")
    assert {p.stderr for p in result.free} == {np.inf}
    assert "thickness may be anything between 0 and 1000 nm" in result.warnings
    assert any("strongly correlated" in message for message in result.warnings)
    record = to_json(result)
    assert record["parameters"]["n_g"]["stderr"] is None
    assert record["noise"] == {"sigma": pytest.approx(0.0025), "source": "given"}


def test_impossible_fits_are_refused(refuses):
    flat = noisy(np.full((200, 3), 0.2), seed=0)
    one = dataclasses.replace(FREE, wavelengths=(550.0,), numbers={**FREE.numbers, "n": 1.5})
    for data, surface, options, message in (
        (flat, Surface("granier-heidrich", {}), {}, "nothing is free"),
        (flat, one, {}, r"3 channels .* for 1 of the surface"),
        (flat, FREE, {"residual": "cubic"}, "residual must be one of linear, cosine, log, cube-root"),
        (flat, FREE, {"loss": "L1"}, "loss must be one of least-squares, huber, student-t"),
        (flat.at(np.arange(5)), FREE, {}, "5 samples are too few"),
        ([], FREE, {}, "no samples"),
    ):
        refuses(UsageError, message, fit, data, surface, **options)
    dark = dataclasses.replace(flat, values=0 * flat.values)
    refuses(DataError, "every value is zero", fit, dark, FREE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "widths"),
    [
        ("granier-heidrich", {f"exponent_{x}": Free(1, 1000) for x in ("reflection", "transmission")}),
        ("microfacet-film", {"roughness": Free(0.003, 1)}),
    ],
)
def test_ptfe_has_no_layer(shared_data, name, widths):
    """Sintered PTFE, measured by NIST: a white diffuser without any film, that interference fits well."""
    ptfe = pl.read_brdf_samples(shared_data / "brdf" / "nist_ptfe_633_532.csv")
    free = {"thickness": Free(0, 1000), "n": Free(1.05, 2.5), "specular": Free(0, 100), "diffuse": Free(0, 2)}
    result = fit(ptfe, Surface(name, free | widths, (633.0, 532.0, 532.0)))
    assert result.verdict.startswith("No evidence of a layer: ")
