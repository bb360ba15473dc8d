"""Ellipsometry through plates: the orders of light between a plate's faces add as Mueller matrices."""

import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.forward_model.film_signal import build
from pellicle.scene.film import with_wavelength

NM = np.array([450.0, 600.0, 800.0])
ANGLE = 65.0
GLASS, K, MM = 1.52, 3e-8, 1.5
TO_STOKES = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, 1j, -1j, 0]])
"""From the coherency vector (x x*, x y*, y x*, y y*), x in the plane of incidence."""


def mueller(p: complex, s: complex) -> np.ndarray:
    """Of what multiplies the two amplitudes by p and s."""
    jones = np.diag([p, s])
    return np.real(TO_STOKES @ np.kron(jones, jones.conj()) @ np.linalg.inv(TO_STOKES))


def sheet(indices, depths, angle, nm) -> list[np.ndarray]:
    """Mueller matrices of r and t from above, r and t from below, by the package tmm."""
    found = []
    below = tmm.snell(indices[0], indices[-1], angle)
    for n, d, theta in ((indices, depths, angle), (indices[::-1], depths[::-1], below)):
        p, s = (tmm.coh_tmm(letter, n, [np.inf, *d, np.inf], theta, nm) for letter in "ps")
        found += [mueller(p["r"], s["r"]), mueller(p["t"], s["t"])]
    return found


def on_a_plate(front: list[np.ndarray], back: np.ndarray, passed: float) -> np.ndarray:
    """The first reflection, and every order from the back face, one after the other."""
    r, t, r_below, t_below = front
    total, inside = r, passed * t
    for _ in range(200):
        inside = back @ inside
        total = total + passed * t_below @ inside
        inside = passed**2 * r_below @ inside
    return total


def ncs(matrix: np.ndarray) -> np.ndarray:
    """tan Ψ exp(iΔ) = conj(r_p / r_s) of tmm's amplitudes: S has the sign of −Im r_p r_s*."""
    return np.array([-matrix[0, 1], matrix[2, 2], -matrix[2, 3]]) / matrix[0, 0]


def expected(front, depths, back, back_depths) -> np.ndarray:
    """The plate absorbs on the way, but its faces are those of a clear one: K is left out there."""
    found = []
    for nm in NM:
        angle = np.deg2rad(ANGLE)
        inside = tmm.snell(1.0, GLASS, angle)
        passed = np.exp(-4e6 * np.pi * K * MM / np.real(np.cos(inside)) / nm)
        upper = sheet([1.0, *front, GLASS], depths, angle, nm)
        lower = sheet([GLASS, *back], back_depths, inside, nm)
        found.append(ncs(on_a_plate(upper, lower[0], passed)))
    return np.array(found)


def simulated(scene: pl.Scene) -> np.ndarray:
    scene = with_wavelength(scene, NM, ANGLE)
    return np.asarray(build(pl.plan(scene))(scene)).reshape(-1, 3)


LIGHT = pl.Light(signal="psi-delta", angle=ANGLE)
PLATE = pl.Substrate(pl.dispersion.Constant(GLASS, K), back=1.0, plate_mm=MM)


@pytest.mark.parametrize("index", [1.46, 2.2 + 0.05j])
def test_a_film_on_a_plate(index):
    found = simulated(pl.Scene(pl.Layer(index, 120.0), PLATE, light=LIGHT))
    np.testing.assert_allclose(found, expected([index], [120.0], [1.0], []), rtol=0, atol=5e-8)
    assert np.all(np.linalg.norm(found, axis=1) < 0.998)  # part of the light is not polarised


def test_films_on_both_faces():
    layers = [
        pl.Layer(2.1, 80.0),
        pl.Layer(1.46, 95.0),
        pl.Plate(pl.dispersion.Constant(GLASS, K), MM),
        pl.Layer(1.38, 110.0),
    ]
    found = simulated(pl.Scene(layers, 3.9 + 0.02j, light=LIGHT))
    exact = expected([2.1, 1.46], [80.0, 95.0], [1.38, 3.9 + 0.02j], [110.0])
    np.testing.assert_allclose(found, exact, rtol=0, atol=5e-8)


def test_the_whole_matrix():
    """All 16 elements; tmm's conjugate amplitudes have the opposite sign of the fourth Stokes parameter."""
    light = pl.Light(signal="mueller", angle=ANGLE)
    scene = with_wavelength(pl.Scene(pl.Layer(2.2 + 0.05j, 120.0), PLATE, light=light), NM, ANGLE)
    found = np.asarray(build(pl.plan(scene))(scene)).reshape(-1, 15)
    for nm, elements in zip(NM, found, strict=True):
        inside = tmm.snell(1.0, GLASS, np.deg2rad(ANGLE))
        passed = np.exp(-4e6 * np.pi * K * MM / np.real(np.cos(inside)) / nm)
        upper = sheet([1.0, 2.2 + 0.05j, GLASS], [120.0], np.deg2rad(ANGLE), nm)
        matrix = on_a_plate(upper, sheet([GLASS, 1.0], [], inside, nm)[0], passed)
        signs = np.diag([1, 1, 1, -1])
        exact = (signs @ matrix @ signs / matrix[0, 0]).ravel()[1:]
        np.testing.assert_allclose(elements, exact, rtol=0, atol=5e-8)


def test_behind_a_metal_nothing_comes_back():
    """The plate is then a half space."""
    with_back, without = (
        simulated(pl.Scene(pl.Layer(0.2 + 3.4j, 400.0), substrate, light=LIGHT))
        for substrate in (PLATE, pl.dispersion.Constant(GLASS, K))
    )
    np.testing.assert_allclose(with_back, without, rtol=0, atol=1e-9)
