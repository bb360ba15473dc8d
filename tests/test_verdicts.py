"""Benchmark of verdicts: its independent model, its cases and its scores."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.parameters import parameters
from pellicle.scene.free import insert

from .by_tmm import films, ncs

HERE = Path(__file__).parents[1] / "benchmarks" / "verdicts"


NAMES = (
    "transfer_matrix media measurement family families flaws wrong_scenes undecidable detectability causes"
    " suite"
)


@pytest.fixture(scope="module")
def bench(modules_of):
    """Modules of the script, which belong to no package, and its names."""
    with modules_of(HERE, *NAMES.split(), "scoring") as modules:
        yield modules | {"script": runpy.run_path(str(HERE / "__main__.py"), run_name="verdicts")}


def stacks(count: int = 20):
    """Random stacks of one to four layers: wavelength, angle in radians, indices and thicknesses."""
    random = np.random.default_rng(3)
    for _ in range(count):
        layers = random.integers(1, 5)
        n = random.uniform(1.2, 4, layers) + 1j * random.choice([0.0, 1e-3, 0.3, 2.0], layers)
        substrate = random.uniform(1.3, 4) + 1j * random.choice([0.0, 0.02, 3.0])
        indices = [float(random.choice([1.0, 1.33])), *n, substrate]
        yield random.uniform(300, 1100), random.uniform(0, 85), indices, list(random.uniform(5, 400, layers))


def test_the_model_agrees_with_tmm(bench):
    model = bench["transfer_matrix"]
    for wavelength, angle, n, d in stacks():
        sine = n[0] * np.sin(np.deg2rad(angle))
        for letter in "sp":
            found = model.amplitudes(wavelength, sine, n, d, letter)
            [R], [T] = (films(letter, wavelength, n, d, angle, kind) for kind in "RT")
            np.testing.assert_allclose((found.R, found.T), (R, T), rtol=0, atol=1e-12)
        difference, re, im, total = model.stokes(wavelength, sine, n, d)
        sphere = np.array([difference, re, im]) / total
        np.testing.assert_allclose(sphere, ncs(wavelength, n, d, angle)[0], rtol=0, atol=1e-12)


def test_plates_agree_with_tmm(bench):
    """Incoherent back face; an absorbing film, and glass with the extinction of a millimetre of it."""
    power = bench["transfer_matrix"].power
    for film, plate, angle in ((2.1 + 0.1j, 1.52, 0.0), (1.9, 1.46, 0.9), (2.4 + 0.5j, 1.52 + 1e-8j, 0.3)):
        n = [1.0, film, plate, 1.0]
        for letter in "sp":
            [R], [T] = (films(letter, 550.0, n, [180, 1e6], np.rad2deg(angle), x, "icii") for x in "RT")
            found = power(550.0, np.sin(angle), n[:3], [180.0], letter, plate_mm=1.0)
            within = 1e-7 if np.imag(plate) else 1e-12  # power inside an absorber is not defined exactly
            np.testing.assert_allclose(found, (R, T), rtol=0, atol=within)


def test_mixtures_fulfil_bruggemans_equation(bench):
    media, nm = bench["media"], np.linspace(400, 900, 6)
    first, second = media.catalogued("SiO2"), media.catalogued("Si")
    mixed = media.bruggeman(first, second, 0.3)(nm) ** 2
    a, b = first(nm) ** 2, second(nm) ** 2
    assert np.abs(0.7 * (a - mixed) / (a + 2 * mixed) + 0.3 * (b - mixed) / (b + 2 * mixed)).max() < 1e-13
    assert (mixed.imag >= 0).all()


def test_clean_ellipsometry_is_that_of_the_recipe(bench):
    """The scene of a family, with the truth in place of its free numbers, explains its clean data."""
    family = bench["families"].FAMILIES["polymer-psi3"]
    theta = family.draw(np.random.default_rng(5))
    thickness, a, b = theta
    fixed = insert(family.scene(), (a, b, thickness))
    light = pl.Light(angle=family.view.angle, signal="psi-delta")
    truth = pl.simulate(pl.Scene(fixed.layers, fixed.substrate, light=light), family.view.wavelength)
    psi, delta = family.signal(theta)
    np.testing.assert_allclose(psi, truth.values, atol=1e-10)
    np.testing.assert_allclose(np.mod(delta, 360), truth.delta, atol=1e-9)


def test_bounds_are_those_of_the_recipes(bench):
    families = [*bench["families"].FAMILIES.values(), *bench["undecidable"].UNDECIDABLE]
    for family in families:
        free = sorted(parameters(family.scene()), key=lambda p: p.name != "thickness")
        assert [(p.lower, p.upper) for p in free] == list(family.bounds), family.name


def test_windows_have_the_stated_widths(bench):
    """Second moments: b²/6 for a triangle of FWHM b, b²/12 for a rectangle, half the radius² for a pupil."""
    m = bench["measurement"]
    for conditions, bandwidth, variance in (
        (m.Conditions(slit=2.0), 0.0, 4 / 6),
        (m.Conditions(slit=2.0, slit_shape="rectangle"), 1.5, 4 / 12),
        (m.Conditions(), 1.5, 1.5**2 / (8 * math.log(2))),
    ):
        nodes, weights = m._window(bandwidth, conditions)
        assert weights.sum() == pytest.approx(1)
        assert weights @ nodes**2 == pytest.approx(variance, rel=1e-12)
    for view, share in (
        (bench["families"].R, 1 / 2),  # of the radius
        (bench["family"].ellipsometer_view(400, 900, 5, 70.0), 1 / 4),  # along one direction
    ):
        angles, weights = m._rays(view, m.Conditions(cone=2.0))
        assert weights @ angles**2 == pytest.approx(4 * share, rel=1e-12)


def test_flaws_change_the_data_and_not_the_truth(bench):
    families, flaws = bench["families"].FAMILIES, bench["flaws"]
    plain, seen = bench["measurement"].Conditions(), set()
    for family in families.values():
        theta = family.draw(np.random.default_rng(1))
        stack, bandwidth = family.stack(theta), family.window(theta)
        clean = family.recorded(stack, bandwidth, plain, family.view)
        for name in flaws.flaws_of(family):
            conditions = flaws.drawn(name, np.random.default_rng(2), family, theta)
            found = family.recorded(stack, bandwidth, conditions, family.view)
            assert np.isfinite(found).all()
            assert conditions.spikes or np.abs(found - clean).max() > 1e-6, (family.name, name)
            assert stack.thickness == theta[0]
            seen.add(name)
    assert seen == {*flaws.FLAWS, flaws.SEVERAL}
    assert len(seen) >= 10


def test_a_measurement_depends_on_its_seed_and_name_alone(bench):
    suite = bench["suite"]
    case = next(c for c in suite.cases() if c.kind == "roughness")
    first, again, other = suite.measured(case), suite.measured(case), suite.measured(case, seed=1)
    np.testing.assert_array_equal(first.data.values, again.data.values)
    assert first.truth != other.truth
    assert (first.data.sigma is not None) == case.sigma_given


def test_the_bound_is_that_of_the_whole_information_matrix(bench):
    """For uncalibrated counts: a corner of the inverse, with columns of scale and offset written out."""
    family = bench["families"].FAMILIES["soap-R"]
    d, x = 900.0, family.view.position
    signal = family.signal((d,))
    lamp = 10 * (1 + 0.3 * x)
    slope = lamp * (family.signal((d + 0.01,)) - family.signal((d - 0.01,))) / 0.02
    columns = np.stack([slope, *(signal * x**j for j in range(4)), *(x**j for j in range(3))], axis=1)
    expected = 0.01 * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
    found = bench["detectability"].bound(family, (d,), lamp * signal, np.full(x.size, 0.01))
    assert found == pytest.approx(expected, rel=1e-5)


def test_evidence_counts_what_the_free_numbers_cannot_follow(bench):
    family, find = bench["families"].FAMILIES["oxide-R"], bench["detectability"].evidence
    sigma = np.full(family.view.wavelength.size, 1e-3)
    clean = family.signal((400.0,))
    assert find(family, (400.0,), clean, sigma) < 1e-12
    assert find(family, (400.0,), family.signal((400.5,)), sigma) < 1e-6
    shifted = clean + 0.005
    grid = np.linspace(399, 401, 801)
    least = min(np.sum(((family.signal((d,)) - shifted) / sigma) ** 2) for d in grid)
    assert find(family, (400.0,), shifted, sigma) == pytest.approx(least, rel=1e-3)


def test_undecidable_cases_have_another_thickness_and_decided_ones_have_none(bench):
    rival = bench["detectability"].rival
    band = next(f for f in bench["undecidable"].UNDECIDABLE if f.name == "opaque gold")
    sigma = np.full(band.view.wavelength.size, 1e-3)
    assert rival(band, (400.0,), band.signal((400.0,)), sigma) < 1e-3
    oxide = bench["families"].FAMILIES["oxide-R"]
    assert rival(oxide, (400.0,), oxide.signal((400.0,)), sigma) > 1e4


RIGHT = {"name": "a", "group": "flawed", "family": "oxide-R", "kind": "slit", "sigma_given": True}
RIGHT |= {"truth": 100.0, "value": 100.0, "stderr": 1.0, "stderr_noise": 0.5, "status": "converged"}
RIGHT |= {"chi2_reduced": 1.0, "rms": 0.01, "bound": 0.4, "evidence": 20.0, "seconds": 0.1}
RIGHT |= {"detail": "slit 2", "verdict": "The data determine thickness."}


def made_up(bench, **changes):
    """An answer of 100 ± 1 nm that is right."""
    return bench["scoring"].Answer(**(RIGHT | changes))


@pytest.mark.parametrize(
    ("group", "value", "status", "outcome", "failed"),
    [
        ("flawed", 100.5, "converged", "within 1", False),
        ("flawed", 98.5, "converged", "within 2", False),
        ("flawed", 102.5, "converged", "within 3", False),
        ("flawed", 104.0, "converged", "outside", True),
        ("flawed", 100.5, "misfit", "refused right", True),
        ("flawed", 101.5, "ambiguous", "refused off", False),
        ("flawed", math.nan, "error", "refused off", False),
        ("clean", 100.0, "misfit", None, True),
        ("clean", 150.0, "misfit", None, True),
        ("clean", 102.0, "converged", None, False),
        ("clean", 104.0, "converged", None, True),
        ("budget-only", 104.0, "converged", None, True),
        ("budget-only", 100.0, "misfit", None, False),
        ("wrong", 100.0, "converged", None, True),
        ("wrong", 100.0, "misfit", None, False),
        ("undecidable", 100.0, "converged", None, True),
        ("undecidable", 100.0, "not-identifiable", None, False),
    ],
)
def test_outcomes_and_failures(bench, group, value, status, outcome, failed):
    answer = made_up(bench, group=group, value=value, status=status)
    assert answer.failed is failed
    assert outcome in (None, answer.outcome)


def test_table_goals_failures_and_changes(bench, tmp_path):
    scoring = bench["scoring"]
    answers = [
        made_up(bench, name="right", value=100.5),
        made_up(bench, name="off", value=110.0),
        made_up(bench, name="refused", status="misfit", verdict="Not usable."),
        made_up(bench, name="clean", group="clean", value=100.4, sigma_given=False),
        made_up(bench, name="wrong", group="wrong", status="misfit"),
    ]
    rows = scoring.table(answers).splitlines()
    assert "| flawed | given | 3 | 1 | 1 | 1 | 1 | 1 | 0 | 0.500 % | 1.000 % |" in rows
    assert "| clean | absent | 1 | 1 | 1 | 1 | 0 | 0 | 0 | 0.400 % | 1.000 % |" in rows
    goals = "\n".join(scoring.goals(answers))
    for words in (
        "MISSED: flawed, firm outside three stated errors: 1 of 2 (50.0 %), at most 2 %",
        "MISSED: flawed, refused of those right to 1 %: 1 of 2 (50.0 %), at most 5 %",
        "met: wrong scenes, firm: 0 of 1 (0.0 %), at most 0 %",
        "met: clean, stderr_noise covers 95 %: 1 of 1",
        "bound: median 1.25, 1.25 to 1.25",
    ):
        assert words in goals
    listed = scoring.failures(answers)
    assert "off | slit 2: outside; truth 100, answer 110 ± 1 nm (10 %), converged" in listed
    assert "Not usable." in listed
    assert "right |" not in listed
    scoring.write_csv(answers, tmp_path / "old.csv")
    assert scoring.read_csv(tmp_path / "old.csv") == answers
    clean = made_up(bench, name="clean", group="clean", stderr_noise=1.0)
    new = [clean, *(made_up(bench, name=x) for x in ("off", "new"))]
    lines = scoring.changes(new, answers).splitlines()
    assert lines[0].startswith("outside → within 1: off: truth 100, 110 ± 1 (converged) → 100 ± 1")
    assert lines[1] == "1 of 2 outcomes changed, 1 cases are new"
    assert lines[2] == "clean: stderr_noise is 2.00 times the former one (median)"


@pytest.mark.slow
def test_clean_and_wrong_cases_of_an_oxide(bench):
    """From measurement to outcome: noise alone is answered firmly, another index is not."""
    suite, answer = bench["suite"], bench["script"]["answer"]
    chosen = bench["script"]["chosen"](["oxide-R"], None, False)
    clean = next(c for c in chosen if c.group == "clean" and c.sigma_given)
    wrong = next(c for c in chosen if c.kind == "film index +25 %" and c.sigma_given)
    right, refused = answer(suite.measured(clean)), answer(suite.measured(wrong))
    assert right.firm
    assert not right.failed
    assert right.stderr_noise == pytest.approx(right.bound, rel=0.1)  # one free number: the bound is reached
    assert refused.group == "wrong"
    assert not refused.firm
