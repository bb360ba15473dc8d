"""A folded Δ is recognised by its kinks at 0 and 180, and nothing else is taken for one."""

from functools import cache

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.signals.folded_delta import can_be_folded, kinks
from tests.data.tables import assert_read

NM = np.arange(300.0, 900.5, 2.0)


seen = jax.jit(lambda d, n, base, angle: pl.ellipsometry(NM, d, n, base, angle=angle))


@cache
def films() -> list[tuple[np.ndarray, np.ndarray]]:
    """Ψ and Δ of 320 films of 10 nm to 5 µm on silicon, gold and glass, at 55 to 75 degrees."""
    rng = np.random.default_rng(0)
    thickness = np.exp(rng.uniform(np.log(10), np.log(5000), (80, 1)))
    angle = rng.uniform(55, 75, (80, 1))
    found = []
    for film, substrate in ((1.46, "Si"), (2.0, "Si"), (1.46, "Au"), (2.0, 1.52)):
        base = substrate if isinstance(substrate, float) else pl.refractive_index(NM, substrate)
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
        psi = np.clip(psi + noise * rng.standard_normal(NM.size), 0, 90)
        delta = (delta + 2 * noise * rng.standard_normal(NM.size)) % 360
        if can_be_folded(delta):
            plain, alarms = plain + 1, alarms + bool(kinks(NM, psi, delta))
        elif delta.min() < 150:
            folded, found = folded + 1, found + bool(kinks(NM, psi, np.minimum(delta, 360 - delta)))
    assert plain > 30
    assert folded > 150
    assert alarms == 0
    assert found > 0.6 * folded


@pytest.mark.parametrize("least", [0.0, 0.5, 5.0])
def test_a_smooth_turn_is_none(least):
    """A parabola that comes as near to 180 as this, with noise."""
    rng = np.random.default_rng(2)
    delta = 180 - least - ((NM - 600) / 30) ** 2
    for noise in (0.0, 0.01, 0.05):
        seen = np.clip(delta + noise * rng.standard_normal(NM.size), 0, 180)
        assert not kinks(NM, np.full(NM.size, 30.0), seen)


@pytest.mark.parametrize("angle", [None, 70.0])
def test_a_spectrum(angle):
    psi, delta = np.full(NM.size, 30.0), 180 - np.abs(NM - 601) / 3
    angles = None if angle is None else np.full(NM.size, angle)
    taken = pl.Spectrum(NM, psi, "psi-delta", delta=delta, angle=angles)
    assert taken.folded is True
    [note] = taken.notes
    assert "at 601 nm: taken as folded" in note
    assert "give `folded=False`" in note
    stated = pl.Spectrum(NM, psi, "psi-delta", folded=False, delta=delta, angle=angles)
    assert_read(stated, folded=False, notes=())
    whole = pl.Spectrum(NM, psi, "psi-delta", delta=180 + (NM - 601) / 3, angle=angles)
    assert whole.folded is False
    assert taken.cut(700, 900).folded is True  # where nothing shows it any more
    assert pl.Spectrum(NM, np.full(NM.size, 0.3), "R").folded is False


def test_only_in_the_kept_range(write):
    """The kink is seen outside of it, as in a file that was cut."""
    delta = 180 - np.abs(NM - 601) / 3
    rows = "".join(f"{nm},30,{d:.6f}\n" for nm, d in zip(NM, delta, strict=True))
    path = write("wl,psi,delta\n" + rows)
    assert read_spectrum(path, range=(700, 900)).folded
    broken = write("wl,psi,delta\n" + rows + "1000,30,250\n")
    assert not read_spectrum(broken).folded
    assert read_spectrum(broken, range=(300, 900)).folded


def test_two_angles(write):
    """Each is a curve of its own; one with a kink is enough."""
    curves = {65: 180 - np.abs(NM - 601) / 3, 75: 90 + (NM - 600) / 10}
    points = [(nm, angle, d) for angle, delta in curves.items() for nm, d in zip(NM, delta, strict=True)]
    rows = "".join(f"{nm},{angle},30,{d:.6f}\n" for nm, angle, d in points)
    assert read_spectrum(write("wl,angle,psi,delta\n" + rows)).folded
