"""Several samples in one fit, with shared numbers."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.empirical import Cauchy
from pellicle.errors import UsageError
from pellicle.fitting.evaluation import explained
from pellicle.fitting.film.fit import measurements
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.samples import shared_by_each
from pellicle.fitting.film.view import SpectrumForm
from pellicle.fitting.result import Estimate, Fit
from pellicle.reporting.fit_text import by_sample

from ... import by_tmm

WAVELENGTH = np.linspace(400.0, 900.0, 60)
DEPTHS = (110.0, 240.0, 430.0)
A, B, NOISE = 1.7, 8e3, 0.003


def spectrum(depth: float, seed: int, glass: bool = False) -> pl.Spectrum:
    """R of a Cauchy film on glass of index 1.52 or on a lossy metal, by the tmm package."""
    below = np.full(60, 1.52) if glass else np.full(60, 2.5 + 3.0j)
    values = by_tmm.films("s", WAVELENGTH, [1, A + B / WAVELENGTH**2, below], [depth])
    values = values + np.random.default_rng(seed).normal(0, NOISE, 60)
    return pl.Spectrum(WAVELENGTH, values, "R", sigma=np.full(60, NOISE), path=f"{depth:g}nm.csv")


def scene(below=2.5 + 3.0j, *, above: list[pl.Layer] | None = None, a=(1.3, 2.2)) -> pl.Scene:
    film = pl.Layer(Cauchy(pl.Free(*a), pl.Free(0, 3e4)), pl.Free(20, 900), "film")
    return pl.Scene([*(above or []), film], below, uncertainty=pl.Uncertainty.none())


def rms_of_pulls(count: int) -> tuple[float, float]:
    """Rms pull of A by the noise alone over a few draws, and its mean error."""
    pulls, errors = [], []
    for seed in range(4):
        data = [spectrum(depth, 10 * seed + i) for i, depth in enumerate(DEPTHS[:count])]
        fit = pl.fit(data, [scene()] * count, shared=["A", "film.B"])
        assert fit.status == "converged"
        pulls += [(fit[x].value - truth) / fit[x].stderr_noise for x, truth in (("A", A), ("film.B", B))]
        pulls += [
            (fit[f"{d:g}nm.film.thickness"].value - d) / fit[f"{d:g}nm.film.thickness"].stderr_noise
            for d in DEPTHS[:count]
        ]
        errors.append(fit["A"].stderr_noise)
    return float(np.sqrt(np.mean(np.square(pulls)))), float(np.mean(errors))


@pytest.mark.slow  # a program of three samples
def test_errors_of_shared_and_own_numbers_cover_the_truth():
    pull, error = rms_of_pulls(3)
    assert 0.6 < pull < 1.5
    assert rms_of_pulls(2)[1] > 1.1 * error


def test_numbers_positions_and_names():
    """Of two samples with other layers and substrates: shared numbers once, by the given names."""
    oxide = pl.Layer("SiO2", pl.Free(1, 9), "oxide")
    data = [spectrum(110.0, 1), spectrum(240.0, 2, True)]
    scenes = [scene(), scene(1.52, above=[oxide])]
    problem = make(*measurements(data, scenes, ["film.A", "film.B"]))
    names = [p.name for p in problem.parameters]
    assert sorted(names) == sorted(
        ["110nm.film.thickness", "240nm.film.thickness", "240nm.oxide.thickness", "film.A", "film.B"]
    )
    of_first, of_second = ({names[i] for i in view.takes} for view in problem.views)
    assert of_first & of_second == {"film.A", "film.B"}


def test_effects_of_media_are_shared_and_those_of_a_sample_its_own():
    data = [spectrum(110.0, 1), spectrum(240.0, 2), spectrum(430.0, 3, True)]
    film = pl.Layer(Cauchy(pl.Free(1.3, 2.2), pl.Free(0, 3e4)), pl.Free(20, 900), "film")
    scenes = [pl.Scene(film, x) for x in (2.5 + 3.0j, 2.5 + 3.0j, 1.52)]
    found = [t.scene.sample for t in measurements(data, scenes, ["A", "B"])]
    assert [dict(s.common) for s in found] == [
        {"film": "", "substrate": " of 110nm"},
        {"film": "", "substrate": " of 110nm"},
        {"film": "", "substrate": " of 430nm"},
    ]


def test_views_of_one_form_are_traced_once(monkeypatch):
    """And their residuals are those of each view by itself."""
    data = [spectrum(depth, i) for i, depth in enumerate(DEPTHS)]
    problem = make(*measurements(data, [scene()] * 3, ["A", "B"]))
    unit = np.linspace(0.2, 0.7, 5)
    values = problem.values(unit)
    alone = [view.form.explain(view.arrays, values[list(view.takes)]) for view in problem.views]
    calls = []
    explain = SpectrumForm.explain
    monkeypatch.setattr(SpectrumForm, "explain", lambda *given: calls.append(given) or explain(*given))
    together, _ = jax.jit(explained, static_argnums=0)(problem.static, problem.arrays, problem.box, unit)
    assert len(calls) == 1
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_allclose(other.residual, one.residual, rtol=1e-9, atol=1e-9)


def test_the_report_lists_numbers_by_sample():
    def number(name):
        return Estimate(name, 1.0, 0.1, "", 0.0, 2.0, True)

    names = ("film.A", "instrument.scale.b", "one.film.thickness", "two.film.thickness")
    parts = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    scenes = tuple(pl.Scene(pl.Layer(1.5, 1.0), 1.6, sample=name) for name in ("one", "two"))
    fit = object.__new__(Fit)  # with what the report looks at
    vars(fit).update(parameters={x: number(x) for x in names}, parts=parts, scene=scenes)
    assert {head: [p.name for p in own] for head, own in by_sample(fit).items()} == {
        "sample one": ["one.film.thickness"],
        "sample two": ["instrument.scale.b", "two.film.thickness"],
        "shared": ["film.A"],
    }


def test_descriptions_share_what_each_has():
    other = pl.Scene(pl.Layer(pl.dispersion.Constant(pl.Free(1, 2)), pl.Free(1, 9), "film"), 1.5)
    given = {"cauchy": [scene(), scene()], "constant": other}
    assert shared_by_each(given, ["A", "film.n"]) == {"cauchy": ["A"], "constant": ["film.n"]}
    with pytest.raises(UsageError, match=r"'film\.x' is free in no description"):
        shared_by_each(given, ["A", "film.x"])


@pytest.mark.parametrize(
    ("scenes", "shared", "said"),
    [
        ([scene(), scene()], ["film.a"], "is free in no sample .did you mean"),
        ([scene(), pl.Scene(pl.Layer(1.5, pl.Free(1, 9)), 1.52)], ["A"], "is free in sample 110nm alone"),
        ([scene(), scene(a=(1.4, 2.2))], ["A"], "has two bounds, 1.3 to 2.2 in sample 110nm and 1.4 to 2.2"),
        ([scene(), scene()], "A", "is a list of names"),
        ([scene(), scene()], [], "share no free number"),
    ],
)
def test_what_cannot_be_shared(scenes, shared, said, refuses):
    refuses(UsageError, said, measurements, [spectrum(110.0, 1), spectrum(240.0, 2)], scenes, shared)
