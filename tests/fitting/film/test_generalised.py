"""Fits of generalised Ψ and Δ: an isotropic film by the package tmm, and a tilted one at several azimuths."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError
from pellicle.fitting.film.problem import measured, seen_as
from pellicle.fitting.film.sweeps import sweeps
from pellicle.reporting import figures
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.figures import draw_spectrum as draw_data
from pellicle.reporting.fit_tables import fit_csv
from pellicle.reporting.fit_text import report
from pellicle.reporting.json_record import to_json
from pellicle.reporting.measured_text import describe
from pellicle.signals.generalised import RATIOS, Generalised, block_frame, delta_sigma, upright
from pellicle.signals.sphere import ncs, sphere_frame

from ... import by_tmm

SIGNAL = "generalised-psi-delta"

NM = np.linspace(400.0, 800.0, 64)
ANGLE, THICKNESS, INDEX, SUBSTRATE = 70.0, 180.0, 1.46, 3.9 + 0.02j
NOISE = np.array([0.03, 0.06, 0.1])
"""Of each ratio, degrees of Ψ."""


def film_ratios(thickness: float = THICKNESS) -> np.ndarray:
    """N, C, S of r_p/r_s, and of two ratios of 0, (points, 3, 3)."""
    own = by_tmm.ncs(NM, [1, INDEX, SUBSTRATE], [thickness], ANGLE)
    none = np.broadcast_to([1.0, 0.0, 0.0], own.shape)
    return np.stack([own, none, none], axis=1)


def data(with_sigma: bool = True) -> pl.Spectrum:
    """The film with a noise of 2σ in any direction on the sphere of each ratio."""
    noise = 2 * np.deg2rad(NOISE)[:, None] * np.random.default_rng(4).normal(size=(64, 3, 3))
    psi, delta = by_tmm.psi_delta(*np.moveaxis(film_ratios() + noise, -1, 0))
    sigma = np.broadcast_to(NOISE, psi.shape) if with_sigma else None
    error = delta_sigma(psi, sigma) if with_sigma else None
    return pl.Spectrum(NM, psi, SIGNAL, sigma=sigma, delta=delta, delta_sigma=error, ratios=RATIOS)


def scene(index: complex = INDEX) -> pl.Scene:
    light = pl.Light(angle=ANGLE, signal=SIGNAL)
    layer, none = pl.Layer(index, pl.Free(10, 500)), pl.Uncertainty.none()
    return pl.Scene(layer, SUBSTRATE, light=light, uncertainty=none)


SLOW = pytest.mark.slow(reason="fits and draws")


@pytest.fixture(scope="module")
def fit() -> pl.Fit:
    return pl.fit(data(), scene())


@SLOW
def test_the_thickness_is_found_with_its_error(fit):
    thickness = fit["thickness"]
    assert fit.status == "converged"
    assert abs(thickness.value - THICKNESS) < 4 * thickness.stderr
    assert fit.chi2_reduced == pytest.approx(1.0, abs=0.2)  # √(2/384) = 0.07
    # by the ratio that depends on it: slopes of its N, C, S from tmm, errors of 2σ each
    slope = (film_ratios(THICKNESS + 0.01) - film_ratios(THICKNESS - 0.01))[:, 0] / 0.02
    expected = 2 * np.deg2rad(NOISE[0]) / np.sqrt(np.sum(slope**2))
    assert thickness.stderr_noise == pytest.approx(expected, rel=0.15)
    assert fit.rms == pytest.approx(np.sqrt(np.mean(NOISE**2)), rel=0.1)


@SLOW
def test_records(fit, write):
    about = to_json(fit)["data"]
    assert about["points"] == 64
    assert about["ratios"] == list(RATIOS)
    assert "generalised-psi-delta (ane, aps, asp), 64 points from 400 to 800 nm" in report(fit)
    path = write(fit_csv(fit), "fit.csv")
    back = read_spectrum(path)
    for name in ("values", "delta", "sigma", "delta_sigma"):
        np.testing.assert_allclose(getattr(back, name), getattr(fit.parts[0].data, name), rtol=1e-8)
    curve = fit.parts[0].curve
    np.testing.assert_allclose(curve.sigma, np.tile(NOISE, (64, 1)), rtol=1e-9)
    np.testing.assert_allclose(curve.model[:, 1:], 0.0, atol=1e-15)


@SLOW
def test_figures_have_psi_and_delta_of_each_ratio(fit):
    cells = draw(fit).axes[:6]
    assert cells[3].get_title(loc="left") == "Δ of AnE (degrees)"
    np.testing.assert_allclose(cells[3].lines[0].get_ydata(), fit.parts[0].data.delta[:, 0])
    panels = figures.of_candidates(fit, [], 0)
    assert "Ψ Aps (degrees)" in str(panels)
    assert len(draw_data(fit.parts[0].data).axes) == 6


@pytest.mark.slow(reason="one more fit")
def test_each_ratio_has_its_own_noise():
    found = pl.fit(data(with_sigma=False), scene())
    np.testing.assert_allclose(found.parts[0].curve.sigma[0], NOISE, rtol=0.2)  # 1/√128 = 0.09
    assert abs(found["thickness"].value - THICKNESS) < 4 * found["thickness"].stderr


def test_channels_are_directions_along_psi_and_delta():
    own = data()
    target = measured(own, scene())
    assert target.signal == Generalised()
    sphere = ncs(own.values, own.delta).reshape(64, -1)
    channels = np.einsum("pij,pj->pi", target.frame, sphere)
    np.testing.assert_allclose(channels, np.tile([0.0] * 6 + [1.0] * 3, (64, 1)), atol=1e-12)
    np.testing.assert_allclose(channels, target.values, atol=1e-12)
    np.testing.assert_allclose(
        target.frame @ np.swapaxes(target.frame, 1, 2), np.tile(np.eye(9), (64, 1, 1)), atol=1e-12
    )
    # 2σ along Ψ and across it
    np.testing.assert_allclose(target.sigma[:, [0, 2, 4]], np.tile(2 * np.deg2rad(NOISE), (64, 1)))
    np.testing.assert_allclose(target.sigma[:, [1, 3, 5]], np.tile(2 * np.deg2rad(NOISE), (64, 1)), rtol=1e-9)
    groups = Generalised(("ane", "aps")).groups(6, True)
    assert [(group.channels, group.independent) for group in groups] == [((0, 1, 4), 2), ((2, 3, 5), 2)]


def test_directions_of_a_ratio_of_nothing_do_not_turn_with_its_noise():
    """Along Ψ, all residuals of a ratio of 0 have one sign; in the directions of C and S they scatter."""
    target = measured(data(), scene())
    model = np.einsum("pij,pj->pi", target.frame, film_ratios().reshape(64, -1))
    residual = ((target.values - model) / target.sigma)[:, :6]
    assert np.max(np.abs(np.mean(residual, axis=0))) < 4 / np.sqrt(64)
    np.testing.assert_allclose(np.std(residual, axis=0), 1.0, atol=4 / np.sqrt(128))


def test_errors_that_differ_keep_their_own_directions():
    psi, delta = np.array([[20.0, 90.0]]), np.array([[100.0, 77.0]])
    frames, sigma = sphere_frame(psi, delta), np.array([[[0.001, 0.004, 0.003], [0.004, 0.004, 0.004]]])
    turned, shared = upright(frames, sigma, psi, delta)
    np.testing.assert_array_equal(turned[0, 0], frames[0, 0])
    np.testing.assert_allclose(shared, sigma, rtol=1e-12)
    # at Ψ = 90, along C and S
    np.testing.assert_allclose(turned[0, 1], [[0, -1, 0], [0, 0, 1], [-1, 0, 0]], atol=1e-12)


def test_some_ratios_alone():
    every = data(with_sigma=False)
    one = replace(every, values=every.values[:, 1:], ratios=("aps", "asp"), delta=every.delta[:, 1:])
    target = measured(one, scene())
    rows = np.arange(18.0).reshape(2, 9)
    np.testing.assert_array_equal(target.signal.compared(rows, None, False), rows[:, 3:])


def test_offsets_are_changes_of_psi_and_delta():
    """Against differences of N, C, S of Ψ and Δ that are moved."""
    psi, delta = np.array([[20.0, 5.0]]), np.array([[100.0, 250.0]])
    step = 1e-4
    allowed = replace(pl.Uncertainty.none(), psi=step, delta=2 * step)
    effects = Generalised(("ane", "aps")).offsets(ncs(psi, delta).reshape(1, -1), allowed)
    names = [f"offset of {angle} of {ratio}" for ratio in ("ane", "aps") for angle in ("psi", "delta")]
    assert [effect.name for effect in effects] == names
    for i, effect in enumerate(effects):
        ratio = np.array([[i // 2 == 0, i // 2 == 1]])
        moved = ncs(psi + step * ratio * (i % 2 == 0), delta + 2 * step * ratio * (i % 2 == 1))
        np.testing.assert_allclose(effect.change, (moved - ncs(psi, delta)).reshape(1, -1), atol=1e-10)
    frames = block_frame(sphere_frame(psi, delta))
    along = np.einsum("pij,pj->pi", frames, effects[2].change)
    np.testing.assert_allclose(along, [[0, 0, 2 * np.deg2rad(step), 0, 0, 0]], atol=1e-12)


def test_azimuths_of_data_and_scene(refuses):
    turned = replace(data(), azimuth=np.repeat([0.0, 45.0], 32))
    light = seen_as(scene(), turned).light
    np.testing.assert_array_equal(light.azimuth, turned.azimuth)
    assert seen_as(scene(), replace(data(), azimuth=np.zeros(64))).light.azimuth is None
    assert seen_as(scene(), replace(data(), azimuth=np.full(64, 30.0))).light.azimuth == 30.0
    stated = replace(scene(), light=pl.Light(angle=ANGLE, signal=SIGNAL, azimuth=45.0))
    assert seen_as(stated, data()).light.azimuth == 45.0
    np.testing.assert_array_equal(seen_as(stated, turned).light.azimuth, turned.azimuth)
    with pytest.raises(UsageError, match="its own azimuths of the sample, 30 degrees, which contradicts"):
        seen_as(stated, replace(data(), azimuth=np.full(64, 30.0)))
    several = replace(scene(), light=pl.Light(angle=ANGLE, signal=SIGNAL, azimuth=np.array([0.0, 45.0])))
    refuses(UsageError, "has no column of azimuths", seen_as, several, data())
    several = replace(scene(), light=pl.Light(angle=np.array([50.0, 60.0]), signal=SIGNAL))
    refuses(UsageError, "has no column of angles of incidence", seen_as, several, replace(data(), angle=None))
    assert "azimuth     0, 45 degrees" in describe(turned)


def test_each_azimuth_has_its_own_sweeps():
    nm, azimuth = np.tile(np.arange(400.0, 410.0), 2), np.repeat([0.0, 90.0], 10)
    order = np.lexsort((azimuth, nm))
    found = sweeps(nm[order], np.full(20, 60.0), azimuth[order])
    assert [azimuth[order][rows].tolist() for rows in found] == [[0.0] * 10, [90.0] * 10]
    around = sweeps(np.full(12, 500.0), np.full(12, 60.0), np.arange(12.0))
    assert [rows.tolist() for rows in around] == [list(range(12))]


def tilted(signal: str, theta, phi, thickness, azimuth=None) -> pl.Scene:
    crystal = pl.Anisotropic(1.6, 1.75, axis=(theta, phi))
    light = pl.Light(angle=60.0, signal=signal, azimuth=azimuth)
    return pl.Scene(pl.Layer(crystal, thickness), "BK7", light=light, uncertainty=pl.Uncertainty.none())


@pytest.mark.slow(reason="fits by the 4x4 method")
@pytest.mark.parametrize(("signal", "noise"), [(SIGNAL, 0.05), ("psi-delta", 0.05), ("R", 0.002)])
def test_a_tilted_film_at_three_azimuths(signal, noise):
    truth = tilted(signal, 40.0, 25.0, 240.0, np.repeat([0.0, 45.0, 90.0], 64))
    found = pl.fit(
        pl.simulate(truth, np.tile(NM, 3), noise=noise, seed=5),
        tilted(signal, pl.Free(10, 80), pl.Free(0, 90), pl.Free(100, 400)),
    )
    assert found.status == "converged"
    for name, value in (("thickness", 240.0), ("axis_theta", 40.0), ("axis_phi", 25.0)):
        assert abs(found[name].value - value) < 4 * found[name].stderr
    assert found.chi2_reduced == pytest.approx(1.0, abs=0.3)
    assert "azimuth from 0 to 90 degrees" in report(found)
