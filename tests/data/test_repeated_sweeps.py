"""Files and spectra of several sweeps over the same wavelengths: what is averaged, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_counts import read_counts, reflectance_from_counts
from pellicle.data.repeated_sweeps import mean_spectrum, repeatability, sweep_numbers
from pellicle.errors import DataError, UsageError
from tests.data.tables import rows

NM = np.arange(400.0, 500.0, 10.0)
LEVELS = 0.3 + 0.1 * np.cos(NM / 20)
SWEEPS = (LEVELS + np.random.default_rng(0).normal(0, 0.003, (3, NM.size))).round(6)


UP = [rows(NM, sweep) for sweep in SWEEPS]
DOWN = [rows(NM[::-1], sweep[::-1]) for sweep in SWEEPS]
ORDERS = {
    "up and up": UP[0] + UP[1] + UP[2],
    "there and back": UP[0] + DOWN[1] + UP[2],
    "down and down": DOWN[0] + DOWN[1] + DOWN[2],
    "each wavelength three times": rows(np.repeat(NM, 3), SWEEPS.T.ravel()),
}


@pytest.mark.parametrize("order", ORDERS)
def test_the_mean_of_complete_sweeps(write, order):
    path = write("wavelength_nm,R\n" + ORDERS[order])
    found = pl.read_spectrum(path)
    np.testing.assert_array_equal(found.wavelength, NM)
    np.testing.assert_allclose(found.values, SWEEPS.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose([s.values for s in found.sweeps], SWEEPS, atol=1e-9)
    assert found.sigma is None
    pooled = np.sqrt(np.mean(SWEEPS.var(axis=0, ddof=1)))
    assert repeatability(found.sweeps) == pytest.approx(pooled)
    assert found.notes[-1].endswith(f"averaged; a point scatters by {pooled:.2g}")


def test_standard_deviations_and_ranges_follow(tmp_path):
    path = tmp_path / "film.csv"
    sigma = np.full(NM.size, 0.006)
    path.write_text("wavelength_nm,R,sigma\n" + rows(NM, SWEEPS[0], sigma) + rows(NM, SWEEPS[1], sigma / 2))
    found = pl.read_spectrum(path, range=(420, 470))
    assert len(found) == 6
    assert [len(sweep) for sweep in found.sweeps] == [6, 6]
    # of a mean of two: half the root of the sum of squares
    np.testing.assert_allclose(found.sigma, 0.5 * np.hypot(0.006, 0.003))
    again = pl.read_spectrum(path, noise=0.004).cut(420, 470)
    np.testing.assert_allclose(again.sigma, 0.004 / np.sqrt(2))
    assert [len(sweep) for sweep in again.sweeps] == [6, 6]


def test_copies_are_left_out(write):
    """An export that holds one sweep twice is no better known for it."""
    path = write("wavelength_nm,R\n" + UP[0] + UP[0])
    found = pl.read_spectrum(path, noise=0.004)
    assert found.sweeps == ()
    np.testing.assert_array_equal(found.sigma, np.full(NM.size, 0.004))
    assert found.notes[-1] == "1 of 2 sweeps hold the same numbers as an earlier one and are left out"
    path.write_text("wavelength_nm,R\n" + UP[0] + DOWN[0] + UP[1])
    found = pl.read_spectrum(path)
    np.testing.assert_allclose(found.values, SWEEPS[:2].mean(axis=0), atol=1e-9)
    assert len(found.sweeps) == 2


def test_repeatability_of_psi_and_delta_is_that_of_psi():
    """Noise of 0.1 in Ψ and of 0.1 / sin 2Ψ in Δ / 2 is 0.1 degrees of Ψ in both directions."""
    rng, psi, delta = np.random.default_rng(0), np.full(400, 30.0), np.full(400, 120.0)
    across = 2 * 0.1 / np.sin(np.deg2rad(60.0))
    nm = np.linspace(400.0, 800.0, 400)
    sweeps = [
        pl.Spectrum(nm, psi + 0.1 * a, "psi-delta", angle=np.full(400, 70.0), delta=delta + across * b)
        for a, b in rng.normal(size=(4, 2, 400))
    ]
    # 2400 degrees of freedom: 1.4 % standard error
    assert repeatability(sweeps) == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (UP[0] + rows(NM[:5], SWEEPS[1][:5]), ("line 12", "400 turns back after 490", "complete sweeps")),
        (rows(NM[[0, 2, 1, 3, 4, 5]], LEVELS[:6]) * 2, ("line 4", "410 turns back after 420")),
        (rows(NM[:4], LEVELS[:4]) * 2, ("line 6", "400 turns back")),  # too short for a sweep
        (rows(NM, LEVELS) + rows(NM, 1.5 * LEVELS), ("2 sweeps", "differ by 28 %", "angle_deg")),
    ],
    ids=["incomplete", "disorder", "short", "different"],
)
def test_other_repetitions_are_refused(write, refusal, text, words):
    refusal(pl.read_spectrum, write("wavelength_nm,R\n" + text), DataError, *words)


def test_two_angles_without_their_column_are_no_repeats(tmp_path, refused):
    nm, path = np.arange(400.0, 800.0, 10.0), tmp_path / "film.csv"
    text = "".join(rows(nm, *pl.ellipsometry(nm, 100.0, "SiO2", "Si", angle=a)) for a in (65.0, 75.0))
    path.write_text("wavelength_nm,psi_deg,delta_deg\n" + text)
    refused(path, "2 sweeps over the same wavelengths differ by", error=DataError)


def test_noise_is_no_difference(tmp_path):
    """Noise as large as the signal is none between sweeps; a lamp that drifts by 5 % is told."""
    noisy = [0.1 + np.abs(x) for x in np.random.default_rng(1).normal(0, 0.1, (2, NM.size * 20))]
    nm = np.linspace(400.0, 800.0, NM.size * 20)
    assert len(mean_spectrum([pl.Spectrum(nm, x, "R") for x in noisy]).sweeps) == 2
    drift = mean_spectrum([pl.Spectrum(NM, LEVELS * gain, "R") for gain in (0.975, 1.025)])
    assert drift.notes[-1].endswith("the sweeps drift")


def test_sweeps_of_raw_counts(write):
    text = rows(NM, 1000 * SWEEPS[0]) + rows(NM, 1000 * SWEEPS[1])
    path = write(f"wavelength_nm,counts\n{text}", "counts.csv")
    reference = pl.Spectrum(NM, np.full(NM.size, 2000.0), "counts")
    found = reflectance_from_counts(read_counts(path), reference, np.full(NM.size, 0.5), noise=0.002)
    np.testing.assert_allclose(found.values, 0.25 * SWEEPS[:2].mean(axis=0), atol=1e-9)
    np.testing.assert_allclose([s.values for s in found.sweeps], 0.25 * SWEEPS[:2], atol=1e-9)
    np.testing.assert_allclose(found.sigma, 0.002 / np.sqrt(2))


def test_a_mean_needs_equal_points(refuses):
    one = pl.Spectrum(NM, LEVELS, "R")
    refuses(UsageError, "two sweeps or more", mean_spectrum, [one])
    for other, name in (
        (pl.Spectrum(NM + 1, LEVELS, "R"), "wavelength"),
        (pl.Spectrum(NM, LEVELS, "T"), "signal"),
        (pl.Spectrum(NM, LEVELS, "R", angle=np.full(NM.size, 30.0)), "angle"),
    ):
        refuses(UsageError, f"the same {name}", mean_spectrum, [one, other])


def test_sweep_numbers_count_earlier_rows():
    rng = np.random.default_rng(0)
    nm, angle = rng.integers(0, 5, 200).astype(float), rng.integers(0, 3, 200).astype(float)
    points = list(zip(nm, angle, strict=True))
    expected = [points[:i].count(point) for i, point in enumerate(points)]
    assert sweep_numbers(nm, angle).tolist() == expected
    assert sweep_numbers(nm).tolist() == [nm[:i].tolist().count(x) for i, x in enumerate(nm)]


def test_four_zones_of_a_real_ellipsometer(tmp_path):
    """The rows of zones 1 to 4, as sweeps, have the mean that the instrument wrote as zone 0."""
    file = Path(__file__).parents[2] / "measurements" / "ellipsometry" / "19-1-1.dat"
    heading, _, *lines = (line.split("\t") for line in file.read_text().splitlines())
    columns = [heading.index(name) for name in ("Zone", "AOI", "Psi", "Delta")]
    table = np.array([[float(line[i]) for i in columns] for line in lines])
    zones = [table[table[:, 0] == zone, 1:].T for zone in (1, 2, 3, 4)]
    path = tmp_path / "zones.csv"
    nm = np.full(zones[0].shape[1], 658.0)
    path.write_text("wavelength_nm,angle_deg,psi_deg,delta_deg\n" + "".join(rows(nm, *z) for z in zones))
    found, own = pl.read_spectrum(path), pl.read_spectrum(file)
    assert len(found.sweeps) == 4
    assert own.angle is not None
    np.testing.assert_array_equal(found.angle, own.angle)
    # written to 0.001 degrees; the instrument averages angles, this averages N, C and S
    np.testing.assert_allclose(found.values, own.values, atol=2e-3)
    np.testing.assert_allclose(found.delta, own.delta, atol=5e-3)
