"""Simulated generalised Ψ and Δ, and samples turned about their normal."""

from typing import Any

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.effects.film_plan import exact
from pellicle.errors import UsageError
from pellicle.optics.anisotropy import Principal, permittivity
from pellicle.scene.film import turned, with_wavelength

SIGNAL = "generalised-psi-delta"

NM = np.linspace(500.0, 700.0, 8)
ANGLE, DEPTH = 60.0, 240.0


def scene(layer: Any, signal: str = SIGNAL, substrate: Any = "BK7", **more: Any) -> pl.Scene:
    light = pl.Light(angle=ANGLE, signal=signal, azimuth=more.pop("azimuth", None))
    return pl.Scene(pl.Layer(layer, DEPTH), substrate, light=light, **more)


def ratios(spectrum: pl.Spectrum) -> np.ndarray:
    """tan Ψ exp(iΔ), (points, ratios)."""
    return np.tan(np.deg2rad(spectrum.values)) * np.exp(1j * np.deg2rad(spectrum.delta))


def crystal(phi: float) -> pl.Anisotropic:
    return pl.Anisotropic(1.6, 1.75, axis=(40.0, phi))


TURNS = (0.0, 25.0, 60.0)


def expected(jones: np.ndarray) -> np.ndarray:
    """Woollam's first index is incident, the last one of pl.jones."""
    pp, ps, sp, ss = (jones[:, i, j] for i in range(2) for j in range(2))
    return np.stack([pp / ss, sp / pp, ps / ss], axis=1).conj()


@pytest.mark.slow
def test_ratios_are_those_of_the_jones_matrix_at_each_azimuth():
    """An azimuth adds to that of every axis."""
    azimuth = np.repeat(TURNS, 8)
    found = pl.simulate(scene(crystal(10.0), azimuth=azimuth), np.tile(NM, 3))
    assert [(own.angle, own.azimuth) for own in found.settings] == [(ANGLE, turn) for turn in TURNS]
    for setting in found.settings:
        jones = np.asarray(pl.jones(NM, DEPTH, crystal(10.0 + setting.azimuth), "BK7", angle=ANGLE))
        np.testing.assert_allclose(ratios(found)[setting.rows], expected(jones), rtol=1e-9)
    assert np.min(np.abs(ratios(found)[:, 1:])) > 1e-3


@pytest.mark.parametrize("azimuth", [0.0, 30.0, -200.0])
def test_a_turned_medium_has_the_rotated_permittivity(azimuth):
    """ε′ = R ε Rᵀ with R about z, from x towards y, as pyElli turns a structure."""
    axis = (50.0, 20.0, 70.0)
    biaxial = pl.Layer(pl.Anisotropic(x=1.5, y=1.6, z=1.8, axis=axis), DEPTH).material
    rows = biaxial.turned(azimuth).index(np.array([500.0]))
    found = np.array([[rows.xx, rows.xy, rows.xz], [rows.xy, rows.yy, rows.yz], [rows.xz, rows.yz, rows.zz]])
    still = permittivity(Principal(1.5, 1.6, 1.8), *np.deg2rad(axis))
    own = np.array(
        [[still.xx, still.xy, still.xz], [still.xy, still.yy, still.yz], [still.xz, still.yz, still.zz]]
    )
    c, s = np.cos(np.deg2rad(azimuth)), np.sin(np.deg2rad(azimuth))
    about = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(found.squeeze(), about @ own @ about.T, atol=1e-14)


@pytest.mark.parametrize("layer", [1.6, pl.Anisotropic(1.6, 1.75, axis=(90, 0))])
def test_films_that_keep_s_and_p_apart(layer):
    found = pl.simulate(scene(layer), NM)
    psi_delta = pl.simulate(scene(layer, "psi-delta"), NM)
    np.testing.assert_allclose(found.values[:, 0], psi_delta.values, rtol=1e-12)
    np.testing.assert_allclose(found.delta[:, 0], psi_delta.delta, rtol=1e-12)
    np.testing.assert_array_equal(found.values[:, 1:], 0.0)
    assert "s and p stay apart, r_ps = r_sp = 0" in exact(scene(layer)).row("anisotropy").why


def test_an_azimuth_has_no_effect_on_an_isotropic_film():
    """The program is that without an azimuth, and the plan says why."""
    from pellicle.forward_model.film_signal import build

    still, moved = (with_wavelength(scene(1.6, "R", azimuth=x), NM) for x in (None, np.full(8, 30.0)))
    assert exact(moved).row("anisotropy").why.endswith("the azimuth of the sample has no effect")
    assert not exact(moved).on("anisotropy")
    texts = [jax.jit(build(exact(each).static_key)).lower(each).as_text() for each in (still, moved)]
    assert texts[0] == texts[1]


def test_the_plan_of_a_turned_sample():
    rows = {
        name: exact(scene(pl.Anisotropic(1.6, 1.75, axis=axis), "R", azimuth=20.0)).row("anisotropy")
        for name, axis in (("normal", (0, 0)), ("surface", (90, 0)), ("tilted", (40, 0)))
    }
    assert rows["normal"].count == 2
    assert "the azimuth of the sample has no effect" in rows["normal"].why
    assert rows["surface"].why.startswith("the sample is turned: s and p mix, matrices of 4×4")
    assert rows["tilted"].why.startswith("an optic axis is tilted")
    still = scene(pl.Anisotropic(1.6, 1.75, axis=(90, 0)))
    assert turned(still) is still


@pytest.mark.slow(reason="compiles an average over the 4x4 method")
def test_depolarised_ratios_are_those_of_the_averaged_mueller_matrix():
    """N, C, S of an uneven film from averages of products of the elements of its Jones matrix."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    jones = np.asarray(pl.jones(NM[0], DEPTH + 5.0 * nodes, crystal(25.0), "BK7", angle=ANGLE))
    flat = jones.reshape(31, 4)
    sums = np.einsum("w,wi,wj->ij", weights, flat, flat.conj())
    found = pl.simulate(scene(crystal(25.0), instrument=pl.Instrument(thickness_spread=5.0)), NM[:2])
    pp, ps, sp, ss = range(4)
    for i, (x, y) in enumerate(((pp, ss), (sp, pp), (ps, ss))):
        n, cross = (sums[y, y] - sums[x, x]).real, 2 * sums[y, x]
        assert found.values[0, i] == pytest.approx(np.rad2deg(np.arctan2(abs(cross), n)) / 2, abs=1e-6)
        assert found.delta[0, i] == pytest.approx(np.rad2deg(np.angle(cross)) % 360, abs=1e-5)


def test_noise_is_the_same_along_and_across_each_ratio():
    nm = np.linspace(400.0, 800.0, 2000)
    noisy, clean = (pl.simulate(scene(1.6), nm, noise=noise, seed=2) for noise in (0.05, 0.0))
    assert noisy.sigma.shape == noisy.delta_sigma.shape == (2000, 3)
    psi = noisy.values[:, 0] - clean.values[:, 0]
    assert np.std(psi) == pytest.approx(0.05, rel=0.05)
    delta = (noisy.delta[:, 0] - clean.delta[:, 0] + 180) % 360 - 180
    assert np.std(delta / noisy.delta_sigma[:, 0]) == pytest.approx(1.0, rel=0.05)
    # of a ratio of 0 the two components of its noise
    assert np.sqrt(np.mean(noisy.values[:, 1] ** 2) / 2) == pytest.approx(0.05, rel=0.05)


def test_refusals(refuses):
    refuses(ValueError, "`azimuth` of the sample cannot be free", pl.Light, azimuth=pl.Free(0, 90))
    with pytest.raises(UsageError, match="`azimuth` has 2 numbers and there are 8 wavelengths"):
        pl.simulate(scene(1.6, azimuth=np.array([0.0, 45.0])), NM)
    refuses(UsageError, "must be among ane, aps, asp", pl.simulate, scene(1.6), NM, elements=["m12"])
    chosen = pl.simulate(scene(1.6), NM, elements=["asp", "ane"])
    assert chosen.ratios == ("asp", "ane")
    assert np.all(chosen.values[:, 0] == 0)
