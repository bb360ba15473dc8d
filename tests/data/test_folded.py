"""Δ without its sign: folded angles, recognised by their kinks too, and α and β of a rotating analyser."""

from functools import cache

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError
from pellicle.optics.ellipsometry import alpha_beta
from pellicle.signals.folded_delta import can_be_folded, kinks
from tests.data.tables import assert_read

NM = np.array([400.0, 500.0, 600.0])
PSI = np.array([20.0, 45.0, 80.0])
DELTA = np.array([170.0, 90.0, 5.0])
ANALYSER = np.array([45.0, 30.0, 60.0])


def ratios(analyser):
    """α and β by the forward formula, from N and C."""
    psi, delta = 2 * np.deg2rad(PSI), np.deg2rad(DELTA)
    return map(np.asarray, alpha_beta(np.cos(psi), np.sin(psi) * np.cos(delta), analyser))


@pytest.mark.parametrize("header", ["wl,alpha,beta,analyser", "nm,α,β,Analyzer (deg)"])
def test_alpha_and_beta_with_their_analyser(write_columns, header):
    spectrum = read_spectrum(write_columns(header, NM, *ratios(ANALYSER), ANALYSER))
    assert_read(spectrum, signal="psi-delta", folded=True, sigma=None, values=PSI, delta=DELTA)


def test_one_analyser_for_all(write_columns):
    path = write_columns("wl,aoi,alpha,beta", NM, np.full(3, 70.0), *ratios(30.0))
    assert_read(read_spectrum(path, analyser=30.0), values=PSI, delta=DELTA, angle=[70.0] * 3)


def test_noise_may_take_the_contrast_above_one(write_columns):
    """At Δ = 180 it does so every other time; α, and with it Ψ, is kept."""
    path = write_columns("wl,alpha,beta", NM, [0.6, 0.6, 1.0], [-0.81, -0.8, -0.01])
    spectrum = read_spectrum(path, analyser=45)
    np.testing.assert_allclose(spectrum.values, np.rad2deg(np.arctan([2.0, 2.0, np.inf])), rtol=1e-12)
    np.testing.assert_allclose(spectrum.delta, 180.0, atol=1e-5)
    assert any("at 2 points whose contrast is above 1" in note for note in spectrum.notes)


def test_a_folded_delta(write_columns):
    path = write_columns("wl,psi,delta", NM, PSI, DELTA)
    assert not read_spectrum(path).folded
    spectrum = read_spectrum(path, folded=True)
    assert_read(spectrum, folded=True, delta=DELTA)
    assert "delta is known in 0 to 180 only: cos(delta) is fitted" in spectrum.notes


@pytest.mark.parametrize(
    ("header", "columns", "words", "error", "said"),
    [
        ("wl,alpha,beta", (0.1, 0.2), {}, UsageError, "`analyser=45`"),
        ("wl,alpha,beta,analyser", (0.1, 0.2, 45), {"analyser": 45}, UsageError, "leave `analyser` out"),
        ("wl,alpha,beta", (0.1, 0.2), {"analyser": 90}, UsageError, "between 0 and 90 degrees, got 90"),
        ("wl,alpha,beta,analyser", (0.1, 0.2, 0), {}, DataError, "line 2, column 'analyser': 0 is not"),
        ("wl,alpha,beta", (0.9, 0.9), {"analyser": 45}, DataError, "contrast of 1.27"),
        ("wl,alpha", (0.1,), {"signal": "psi-delta", "analyser": 45}, DataError, "are not all among"),
        ("wl,psi,delta", (45, 200), {"folded": True}, DataError, "0 to 180 degrees, as a folded delta is"),
        ("wl,psi,delta", (45, 90), {"analyser": 45}, UsageError, "goes with columns alpha and beta"),
        ("wl,N,C,S", (0, 0, 1), {"folded": True}, UsageError, "contain the sign of delta"),
        ("wl,R", (0.5,), {"folded": True}, UsageError, "`folded` is for ellipsometry"),
        ("wl,R", (0.5,), {"analyser": 45}, UsageError, "`analyser` is for ellipsometry"),
    ],
)
def test_what_makes_no_sense(write_columns, header, columns, words, error, said, refuses):
    path = write_columns(header, [500.0, 600.0], *([value, value] for value in columns))
    refuses(error, said, read_spectrum, path, **words)


FINE = np.arange(300.0, 900.5, 2.0)


seen = jax.jit(lambda d, n, base, angle: pl.ellipsometry(FINE, d, n, base, angle=angle))


@cache
def films() -> list[tuple[np.ndarray, np.ndarray]]:
    """Ψ and Δ of 320 films of 10 nm to 5 µm on silicon, gold and glass, at 55 to 75 degrees."""
    rng = np.random.default_rng(0)
    thickness = np.exp(rng.uniform(np.log(10), np.log(5000), (80, 1)))
    angle = rng.uniform(55, 75, (80, 1))
    found = []
    for film, substrate in ((1.46, "Si"), (2.0, "Si"), (1.46, "Au"), (2.0, 1.52)):
        base = substrate if isinstance(substrate, float) else pl.refractive_index(FINE, substrate)
        psi, delta = seen(thickness, film, base, angle)
        found += list(zip(np.asarray(psi), np.asarray(delta), strict=True))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
def test_films(noise):
    """No alarm where nothing is folded; of folded ones those with several points in a fringe are found."""
    rng = np.random.default_rng(1)
    alarms, found, plain, folded = 0, 0, 0, 0
    for psi, delta in films():
        psi = np.clip(psi + noise * rng.standard_normal(FINE.size), 0, 90)
        delta = (delta + 2 * noise * rng.standard_normal(FINE.size)) % 360
        if can_be_folded(delta):
            plain, alarms = plain + 1, alarms + bool(kinks(FINE, psi, delta))
        elif delta.min() < 150:
            folded, found = folded + 1, found + bool(kinks(FINE, psi, np.minimum(delta, 360 - delta)))
    assert plain > 30
    assert folded > 150
    assert alarms == 0
    assert found > 0.6 * folded


@pytest.mark.parametrize("least", [0.0, 0.5, 5.0])
def test_a_smooth_turn_is_none(least):
    """A parabola that comes as near to 180 as this, with noise."""
    rng = np.random.default_rng(2)
    delta = 180 - least - ((FINE - 600) / 30) ** 2
    for noise in (0.0, 0.01, 0.05):
        seen = np.clip(delta + noise * rng.standard_normal(FINE.size), 0, 180)
        assert not kinks(FINE, np.full(FINE.size, 30.0), seen)


@pytest.mark.parametrize("angle", [None, 70.0])
def test_a_spectrum(angle):
    psi, delta = np.full(FINE.size, 30.0), 180 - np.abs(FINE - 601) / 3
    angles = None if angle is None else np.full(FINE.size, angle)
    taken = pl.Spectrum(FINE, psi, "psi-delta", delta=delta, angle=angles)
    assert taken.folded is True
    [note] = taken.notes
    assert "at 601 nm: taken as folded" in note
    assert "give `folded=False`" in note
    stated = pl.Spectrum(FINE, psi, "psi-delta", folded=False, delta=delta, angle=angles)
    assert_read(stated, folded=False, notes=())
    whole = pl.Spectrum(FINE, psi, "psi-delta", delta=180 + (FINE - 601) / 3, angle=angles)
    assert whole.folded is False
    assert taken.cut(700, 900).folded is True  # where nothing shows it any more
    assert pl.Spectrum(FINE, np.full(FINE.size, 0.3), "R").folded is False


def test_only_in_the_kept_range(write):
    """The kink is seen outside of it, as in a file that was cut."""
    delta = 180 - np.abs(FINE - 601) / 3
    rows = "".join(f"{nm},30,{d:.6f}\n" for nm, d in zip(FINE, delta, strict=True))
    path = write("wl,psi,delta\n" + rows)
    assert read_spectrum(path, range=(700, 900)).folded
    broken = write("wl,psi,delta\n" + rows + "1000,30,250\n")
    assert not read_spectrum(broken).folded
    assert read_spectrum(broken, range=(300, 900)).folded


def test_two_angles(write):
    """Each is a curve of its own; one with a kink is enough."""
    curves = {65: 180 - np.abs(FINE - 601) / 3, 75: 90 + (FINE - 600) / 10}
    points = [(nm, angle, d) for angle, delta in curves.items() for nm, d in zip(FINE, delta, strict=True)]
    rows = "".join(f"{nm},{angle},30,{d:.6f}\n" for nm, angle, d in points)
    assert read_spectrum(write("wl,angle,psi,delta\n" + rows)).folded
