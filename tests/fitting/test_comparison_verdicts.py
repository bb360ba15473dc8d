"""Verdicts on descriptions of one film, isotropic and birefringent ones, from fits written down by hand."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting import comparison
from pellicle.fitting.comparison import Candidate, Comparison, best_explained
from pellicle.fitting.curves import BIREFRINGENCE, Curve, Index
from pellicle.fitting.result import Estimate, Part, Status
from pellicle.forward_model.plan import Plan, Row
from tests.made_fits import made_fit


def candidate(
    name: str,
    evidence: float,
    delta: tuple[float, float] | None = None,
    angles: tuple[str, ...] | None = None,
) -> Candidate:
    """A candidate with a birefringence and its error, or isotropic; `angles` are those of a tilted axis."""
    nm, zero = np.array([400.0, 500.0]), np.zeros(2)
    principal = {}
    if delta is not None:
        n, error = delta
        # at 400 nm it is half as clear
        principal[BIREFRINGENCE] = Index(nm, np.full(2, n), zero, np.array([2 * error, error]), zero)
    free = ["ordinary.n", "extraordinary.n"] if delta else ["n"]
    free += angles or ()
    size = 0 if delta is None else 2 if angles is None else 4
    plan = Plan((Row("anisotropy", delta is not None, "", count=size),), "psi-delta", "unpolarised")
    curve = Curve(nm, zero, zero + 1, zero, zero, zero, zero, zero, principal=principal)
    part = Part("", pl.Spectrum(nm, zero + 0.2, "R"), curve, plan, 0.0, 1.0, 2.0)
    parameters = (Estimate(word, 1.0, 0.1, "", 0.0, 9.0, True) for word in ("thickness", *free))
    return Candidate(
        name, made_fit(part, parameters=parameters), 1 + len(free), 0.0, 0.0, -2 * evidence, evidence
    )


@pytest.mark.parametrize(
    ("difference", "delta", "expected"),
    [
        (-50.0, (0.03, 0.007), "the data strongly favour birefringence, 0.03 ± 0.007 at 500 nm."),
        (-38.0, (0.002, 0.007), "usual errors of instruments and samples would imitate it."),
        (2.1, (0.0, 0.007), "birefringence is not needed."),
        (2.1, (0.0, 0.5), "birefringence is not needed, and these data would not show it."),
        (0.5, (0.0, 0.007), "prefer isotropic, which has fewer free parameters."),
    ],
)
def test_birefringence_is_called_what_it_is(difference, delta, expected):
    both = candidate("isotropic", difference), candidate("uniaxial", 0.0, delta)
    assert Comparison(both, 100.0).verdict.endswith(expected)


@pytest.mark.parametrize("angles", [(), ("axis_theta",), ("film.axis_theta", "film.axis_phi")])
@pytest.mark.parametrize(
    ("difference", "expected"),
    [(-6.0, "the data strongly favour a tilted optic axis."), (6.0, "a tilted optic axis is not needed.")],
)
def test_tilt_is_called_what_it_is(difference, expected, angles):
    """Against an axis along the normal, whether its angles are free or given."""
    both = candidate("aligned", difference, (0.1, 0.01)), candidate("tilted", 0.0, (0.1, 0.01), angles)
    assert Comparison(both, 100.0).verdict.endswith(expected)


@pytest.mark.parametrize(
    ("error", "words"), [(0.4, "the data favour native.k"), (0.2, "the data strongly favour native.k")]
)
def test_evidence_is_strong_where_the_number_is_beyond_its_total_error(error, words):
    """ln Z of a number within its total error may be higher where a model is wrong in another way."""
    plain, more = candidate("plain", -25.0), candidate("more", 0.0)
    native = Estimate("native.k", 1.0, error, "", 0.0, 9.0, True, stderr_noise=0.01)
    fit = dataclasses.replace(more.fit, parameters=more.fit.parameters | {"native.k": native})
    assert words in Comparison((plain, dataclasses.replace(more, fit=fit, free=3)), 100.0).verdict


@pytest.mark.parametrize("status", [Status.CONVERGED, Status.MISFIT])
def test_causes_are_looked_for_of_the_best_alone_and_only_of_a_misfit(monkeypatch, status):
    worse, best = candidate("worse", -9.0), candidate("best", 0.0)
    fits = {
        "worse": dataclasses.replace(worse.fit, status=Status.MISFIT),
        "best": dataclasses.replace(best.fit, status=status),
    }

    def fit(name, explained):
        return dataclasses.replace(fits[name], warnings=("a cause",) if explained else ())

    def compare(done):
        rows = (dataclasses.replace(row, fit=done[row.name]) for row in (worse, best))
        return Comparison(tuple(rows), 100.0)

    monkeypatch.setattr(comparison, "compare", compare)
    causes = {row.name: row.fit.warnings for row in best_explained(fits, fit).candidates}
    assert causes == {"worse": (), "best": ("a cause",) if status is Status.MISFIT else ()}
