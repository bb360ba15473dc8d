"""Rounds of the search: what is drawn anew, what is kept, and when it stops. Programs are replaced."""

import dataclasses
import itertools

import jax
import numpy as np
import pytest
from scipy.optimize import nnls

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting import minima as solver
from pellicle.fitting.brdf import search as module
from pellicle.fitting.brdf.problem import incoherent, make, without_layer
from pellicle.fitting.brdf.search import Candidates, Effort, candidates, scan, search
from pellicle.fitting.brdf.view import BLOCK
from pellicle.fitting.evaluation import Polished
from pellicle.fitting.minima import Minima
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import quiet
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from .conftest import TILTED, ones

FEW = Effort(candidates=6, short=4, starts=2)
LOBES = slice(2, 4)
"""Exponent and deviation, after thickness and index."""


@pytest.fixture
def grey() -> Problem:
    """A problem of five numbers, the last one a weight."""
    free = ("thickness", "n", "exponent_reflection", "deviation", "specular")
    surface = Surface("granier-heidrich", {key: TILTED.numbers[key] for key in free}, (550.0,))
    data = ones(30.0, 0.0, np.arange(10.0, 60.0), 180.0, ("value",))
    return make([data], [""], surface, [pl.plan(surface, directions=data)], "linear")


class Programs:
    """Replaced programs: χ² is what `rule` says of a candidate, and polishing leaves it where it is."""

    def __init__(self, monkeypatch, rule):
        self.rule, self.scanned, self.seen, self.short, self.final = rule, [], [], [], []
        monkeypatch.setattr(module, "scan", self.scan)
        monkeypatch.setattr(module, "solve", self.solve)
        monkeypatch.setattr(module, "minima", self.minima)

    def scan(self, family, member, samples, fixed, box, units):
        self.scanned.append(units)
        self.seen.append(samples)
        return Candidates(self.rule(units), np.full((len(units), 1), 0.1))

    def solve(self, few, starts, *, steps):
        self.short.append(starts)
        return Minima(starts, self.rule(starts), np.ones(len(starts), bool))

    def minima(self, problem, starts, progress, *, most, followed, coarse):
        self.final.append((starts, most, followed))
        return Minima(starts, self.rule(starts), np.ones(len(starts), bool))


def test_a_surface_and_those_that_judge_it_share_two_programs(monkeypatch):
    """One scan and one polish, of few samples and of all: nine programs took most of a first fit."""
    seen = set()

    def program(name, static, arguments):
        shapes = [(np.shape(x), np.result_type(x)) for x in jax.tree.leaves(arguments)]
        seen.add((name, static, jax.tree.structure(arguments), tuple(shapes)))

    def scanned(family, *arguments):
        program("scan", family, arguments)
        units, most = arguments[-1], max(each.size for each in family)
        return Candidates(1 + np.arange(len(units)), np.full((len(units), most), 0.5))

    def polished(static, *arguments):
        program("polish", static, arguments)
        units = arguments[-2]
        return Polished(units, 1 + units[:, 0], np.ones(len(units), bool), np.ones(len(units), int))

    monkeypatch.setattr(module, "scan", scanned)
    monkeypatch.setattr(solver, "polish", polished)
    data = ones(30.0, 0.0, np.linspace(10.0, 60.0, 1000), 180.0)
    whole = make([data], [""], TILTED, [pl.plan(TILTED, directions=data)], "linear")
    for problem in (whole, incoherent(whole), without_layer(whole)):
        search(problem, FEW, quiet)
    assert sorted(name for name, *_ in seen) == ["polish", "scan"]


def distance(units):
    """χ² of a problem whose best thickness is 0.8 of its range and whose best index 0.2."""
    return 1 + np.abs(units[:, 0] - 0.8) + np.abs(units[:, 1] - 0.2)


def test_later_rounds_keep_the_lobes_and_draw_the_fringes(grey, monkeypatch):
    programs = Programs(monkeypatch, distance)
    search(grey, FEW, quiet)
    first, second = (units[:6] for units in programs.scanned[:2])
    np.testing.assert_array_equal(first, candidates(grey, 6))
    np.testing.assert_array_equal(second[:, :2], candidates(grey, 6, seed=1)[:, :2])
    parents = first[np.argsort(distance(first))]
    shorts = programs.short[0][:, :4]
    np.testing.assert_array_equal(shorts, parents[:4])  # all of them over 2 nm apart
    np.testing.assert_array_equal(second[:, LOBES], np.resize(shorts, (6, 4))[:, LOBES])


def halving():
    better = itertools.count(1)
    return lambda units: np.full(len(units), 0.5 ** next(better))


@pytest.mark.parametrize(
    ("rule", "short", "rounds"),
    # at most four, the last of which gains nothing, and one without a short polish
    [(lambda units: np.ones(len(units)), 4, 2), (halving(), 4, 4), (distance, 0, 1)],
)
def test_rounds_end_with_one_that_gains_nothing(grey, monkeypatch, rule, short, rounds):
    programs = Programs(monkeypatch, rule)
    search(grey, FEW._replace(short=short), quiet)
    assert len(programs.scanned) == rounds
    assert bool(programs.short) == bool(short)


def test_the_last_starts_are_the_best_of_all_rounds_two_nanometres_apart(grey, monkeypatch):
    programs = Programs(monkeypatch, distance)
    search(grey, FEW, quiet)
    [(starts, most, followed)] = programs.final
    assert (starts.shape, most, followed) == ((2, 5), 2, 0)
    seen = np.concatenate(programs.short)
    assert distance(starts)[0] == distance(seen).min()
    assert abs(starts[0, 0] - starts[1, 0]) * 1000 >= 2


def test_starts_of_one_thickness_are_filled_up_with_the_next_best(grey, monkeypatch):
    """Fewer thicknesses than starts: the rest are the best of what is left."""
    monkeypatch.setattr(module, "candidates", lambda problem, count, seed=0: np.full((count, 4), 0.5))
    programs = Programs(monkeypatch, lambda units: np.arange(1.0, len(units) + 1))
    search(grey, FEW, quiet)
    [(starts, _, _)] = programs.final
    np.testing.assert_allclose(starts, np.tile([0.5, 0.5, 0.5, 0.5, 0.1], (2, 1)))


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_scan_sees_samples_of_all_values(grey, monkeypatch, count):
    """150 of several views, from the darkest to the brightest, some twice where there are fewer. Few of one
    view stay as they are, so that its polish and the scan share their shapes."""
    programs = Programs(monkeypatch, distance)
    [view] = grey.views
    weight = np.array(view.data.weight)
    weight[10:20] = 0.0  # held out
    several = []
    for own in range(count):
        values = np.zeros_like(view.data.values)
        values[: view.rows, 0] = own * view.rows + np.arange(view.rows)
        several.append(dataclasses.replace(view, data=view.data._replace(weight=weight, values=values)))
    search(grey._replace(views=tuple(several)), FEW, quiet)
    chosen = programs.seen[0]
    if count == 1:
        assert chosen is several[0].data
        return
    assert chosen.values.shape == (BLOCK, 1)
    fitted = [own * 50 + row for own in range(count) for row in range(50) if not 10 <= row < 20]
    seen = np.searchsorted(fitted, np.unique(chosen.values))
    assert set(np.unique(chosen.values)) <= set(fitted)
    assert (seen[0], seen[-1]) == (0, len(fitted) - 1)
    assert np.diff(seen).max() <= max(1, len(fitted) // BLOCK + 1)
    assert count == 4 or len(seen) == len(fitted)


def tilted(phi_o) -> Problem:
    data = ones(30.0, 0.0, np.arange(10.0, 60.0), phi_o)
    return make([data], [""], TILTED, [pl.plan(TILTED, directions=data)], "linear")


def test_folded_candidates_are_even_in_the_tilt_out_of_the_plane():
    """Uniform in y, where the coordinate is y²: a third of them below y = 1/3."""
    drawn = candidates(tilted(180.0), 3000)[:, 6]
    assert np.mean(drawn < 1 / 9) == pytest.approx(1 / 3, abs=0.03)


def test_candidates_of_a_channel_are_near_those_of_the_first():
    problem = tilted(np.arange(100.0, 150.0))
    drawn = candidates(problem, 500, seed=3)
    assert drawn.shape == (500, 7)
    assert ((drawn >= 0) & (drawn <= 1)).all()
    index = 1.05 + 1.45 * drawn[:, 1:4]
    apart = np.abs(index[:, 1:] - index[:, :1])
    assert apart.max() <= 0.1 + 1e-12
    assert apart.max() > 0.09
    np.testing.assert_array_equal(drawn, candidates(problem, 500, seed=3))
    assert not np.array_equal(drawn, candidates(problem, 500))


SURFACE = Surface(
    "microfacet-film", {"roughness": Free(0.003, 1), "specular": Free(0, 100), "diffuse": Free(0, 2)}
)


@pytest.fixture(scope="module")
def layered() -> Problem:
    """Values of either sign around the model's, so that some best weights are 0."""
    rng = np.random.default_rng(1)
    theta_i = np.repeat([20.0, 40.0, 60.0], 20)
    theta_o = theta_i + np.tile(np.linspace(-12, 12, 20), 3)
    values = np.abs(0.2 + 0.3 * rng.standard_normal((60, 3)))
    zero = np.zeros(60)
    data = BrdfSamples(
        theta_i, zero, theta_o, zero + 180, values, ("R", "G", "B"), sigma=rng.uniform(0.1, 0.3, (60, 3))
    )
    return make([data], [""], SURFACE, [pl.plan(SURFACE, directions=data)], "linear")


def expected(problem: Problem, shapes: np.ndarray) -> tuple[np.ndarray, float]:
    """The best weights at values `shapes` of the other numbers, in their own units, and χ²."""
    [view] = problem.views
    count = len(problem.parameters) - len(shapes)
    weights, chi2 = np.zeros(count), 0.0

    def residuals(weights):
        rows = view.residuals(view.local(np.concatenate([shapes, weights])))
        return rows if count > 2 else rows.reshape(-1, 1)  # grey: one problem of all channels

    data = residuals(weights)
    lobes = np.array([data - residuals(one) for one in np.eye(count)])
    groups = data.shape[1]
    for channel in range(groups):
        own = slice(channel, None, groups)
        weights[own], norm = nnls(lobes[own, :, channel].T, data[:, channel])
        chi2 += norm**2
    return weights, chi2


@pytest.mark.slow
@pytest.mark.parametrize("kind", [lambda p: p, without_layer], ids=["layer", "two lobes"])
def test_weights_are_the_nonnegative_least_squares(layered, kind):
    """Of all channels together where a weight is grey, else of each channel."""
    problem = kind(layered)
    [view] = problem.views
    size = 1 if kind is not without_layer else 3
    units = np.random.default_rng(2).random((12, size))
    solved = scan((problem.member,), 0, *view.arrays, problem.box, units)
    lower, upper = problem.box.lower[size:], problem.box.upper[size:]
    on_zero = 0
    for unit, chi2, weights in zip(units, solved.chi2, np.asarray(solved.weights), strict=True):
        shapes = np.asarray(problem.values(np.concatenate([unit, weights])))[:size]
        best, least = expected(problem, shapes)
        np.testing.assert_allclose(lower + weights * (upper - lower), best, atol=1e-6 * (1 + best.max()))
        assert float(chi2) == pytest.approx(least, rel=1e-8)
        on_zero += np.count_nonzero(best == 0)
    assert 0 < on_zero < 12 * len(lower)
