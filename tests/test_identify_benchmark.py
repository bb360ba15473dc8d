"""Benchmark of identifications: its simulator against the forward model, its cases and its scores."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pellicle as pl

HERE = Path(__file__).parents[1] / "benchmarks" / "identify"


@pytest.fixture(scope="module")
def bench(modules_of):
    with modules_of(HERE, "specimens", "suite", "scoring") as modules:
        yield SimpleNamespace(**modules)


@pytest.mark.parametrize(
    ("signal", "angle", "back"), [("R", 0.0, ""), ("T", 0.0, "air"), ("psi-delta", 70.0, "")]
)
def test_the_simulator_agrees_with_the_forward_model(bench, signal, angle, back):
    s = bench.specimens
    film = s.Specimen((s.Layer("TiO2", 90.0), s.Layer("SiO2", 120.0)), "BK7", back)
    view = s.View(signal, angle, 0.0, points=12)
    layers = [pl.Layer(s.PAGES["TiO2"], 90.0), pl.Layer("SiO2", 120.0)]
    substrate = pl.Substrate("BK7", back=back or None)
    own = pl.simulate(pl.Scene(layers, substrate, light=pl.Light(angle=angle, signal=signal)), view.nm)
    expected = own.values if own.delta is None else np.stack([own.values, own.delta], axis=1)
    np.testing.assert_allclose(s.clean(film, view), expected, atol=2e-5)


def test_flaws_change_the_signal_by_their_size(bench):
    s = bench.specimens
    film = s.Specimen((s.Layer("Si3N4", 200.0),), "Si")
    view = s.View("R", 0.0, 0.0, points=12)
    plain = s.clean(film, view)
    level = s.clean(replace(film, flaws=s.Flaws(scale=0.01, offset=0.002)), view)
    np.testing.assert_allclose(level, 1.01 * plain + 0.002)
    for flaw in ("spread", "rough", "carbon", "bandwidth"):
        off = np.abs(s.clean(replace(film, flaws=s.Flaws(**{flaw: 1.0})), view) - plain).max()
        assert 1e-5 < off < 0.05, flaw


def test_cases_are_many_named_once_and_drawn_anew_by_another_seed(bench):
    cases = bench.suite.cases(bench.suite.SEED)
    assert len(cases) >= 200
    assert len({case.name for case in cases}) == len(cases)
    again = bench.suite.cases(bench.suite.SEED)
    other = bench.suite.cases(bench.suite.HELD_OUT)
    assert cases == again
    assert cases[0].specimen != other[0].specimen


def trivial(case, status, offset=0.0):
    """An identification that knows the truth, off by `offset` nm."""
    nm, layers = case.view.nm, []
    for layer in case.specimen.layers:
        n = layer.index(nm).real
        depth = SimpleNamespace(value=layer.thickness + offset, stderr=1.0)
        layers.append(SimpleNamespace(material=layer.material, n=(n.min(), n.max()), thickness=depth))
    return answered(status, layers)


def answered(status, layers, name="a film"):
    """An identification with one hypothesis."""
    return SimpleNamespace(
        status=status, hypotheses=[SimpleNamespace(name=name, layers=layers, remaining=1.0)]
    )


def test_scores_of_a_trivial_identifier(bench):
    score, by_group = bench.scoring.score, {x.group: x for x in bench.suite.cases(1)}
    film = by_group["two layers"]
    assert score(film, trivial(film, "identified")) == ("right", True)
    assert score(film, trivial(film, "undecided")) == ("listed", True)
    assert score(film, trivial(film, "identified", 40.0)) == ("wrong", True)
    assert score(film, trivial(film, "undecided", 40.0)) == ("missed", True)
    assert score(film, SimpleNamespace(status="none", hypotheses=[])) == ("silent", False)
    # a layer too many
    assert score(by_group["not there"], trivial(by_group["there"], "identified")) == ("wrong", False)
    assert score(by_group["wrong substrate"], trivial(film, "identified")) == ("wrong", False)
    assert score(by_group["wrong substrate"], trivial(film, "undecided"))[0] == "right"
    bare = by_group["no film"]
    assert score(bare, trivial(bare, "identified")) == ("right", True)
    oxide = [
        SimpleNamespace(material="SiO2", n=(1.46, 1.46), thickness=SimpleNamespace(value=12.0, stderr=4.0))
    ]
    assert score(bare, answered("identified", oxide, "bare substrate")) == ("right", True)
    assert score(bare, answered("identified", oxide))[0] == "wrong"


def test_layers_of_one_index_are_one_film(bench):
    score, cases = bench.scoring.score, {x.name: x for x in bench.suite.cases(1)}
    case = cases["two layers | PMMA on SiO2 1 | psi-delta on Si"]
    (n, depth), *rest = bench.scoring.films(case)
    one = SimpleNamespace(material="SiO2", n=(n, n), thickness=SimpleNamespace(value=depth, stderr=1.0))
    assert (rest, score(case, answered("identified", [one]))) == ([], ("right", True))
    assert depth == pytest.approx(sum(x.thickness for x in case.specimen.layers))
    assert score(case, trivial(case, "undecided"))[0] == "listed"
    assert len(bench.scoring.films(cases["two layers | SiO2 on TiO2 1 | R on Si"])) == 2


def test_shares_of_a_run(bench):
    about = {"films": 2, "close": True, "truth": "", "answer": "", "verdict": "", "seconds": 1.0}
    rows = [("clean", "right", np.nan), ("clean", "wrong", np.nan), ("there", "listed", 9.0)]
    made = [
        bench.scoring.Answer(f"{i}", group, "identified", outcome, True, gain=gain, **about)
        for i, (group, outcome, gain) in enumerate(rows)
    ]
    assert "a layer that is there and that the data need: 1 of 1 (100 %); goal all" in bench.scoring.goals(
        made
    )
    assert bench.scoring.goals(made)[0] == "confidently wrong: 1 of 3 (33 %); goal 3 %"
    assert "| all | 3 | 1 | 1 | 1 | 0 | 0 | 1.0 |" in bench.scoring.table(made)
    assert bench.scoring.failures(made).startswith("- 1: truth")


def test_probabilities_of_one_film_under_several_names_add_up(bench):
    case = next(x for x in bench.suite.cases(1) if x.group == "clean")
    other, same, best = (trivial(case, "undecided", by).hypotheses[0] for by in (40.0, 1.0, 0.0))
    for hypothesis, probability in ((best, 0.5), (same, 0.3), (other, 0.2)):
        hypothesis.probability = probability
    found = SimpleNamespace(hypotheses=[best, same, other])
    assert bench.scoring.best_film(case, found) == (pytest.approx(0.8), True)
    found.hypotheses = [other, best, same]
    assert bench.scoring.best_film(case, found) == (pytest.approx(0.2), False)


def test_reliability_counts_samples_with_films_that_are_stated_rightly(bench):
    about = ("undecided", "listed", True, 1, True, "", "", "", 1.0, np.nan)
    rows = [
        ("clean", 0.96, True),
        ("clean", 0.98, False),
        ("wrong substrate", 0.97, False),
        ("there", 0.3, True),
    ]
    made = [bench.scoring.Answer(f"{i}", own[0], *about, *own[1:]) for i, own in enumerate(rows)]
    lines = bench.scoring.reliability(made).splitlines()
    assert lines[2:] == ["| 0 to 0.5 | 1 | 0.30 | 1.00 |", "| 0.95 to 0.99 | 2 | 0.97 | 0.50 |"]
