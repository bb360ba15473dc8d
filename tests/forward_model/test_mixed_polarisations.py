"""Birefringent films with tilted axes on incoherent plates, against averages over the phase in the plate."""

from typing import Any

import jax
import numpy as np
import pytest
from scipy.linalg import expm

import pellicle as pl
from pellicle.forward_model.film_signal import build
from pellicle.scene.film import with_wavelength
from pellicle.scene.free import insert, start_values

from ..optics.lens_reference import TO_STOKES, berreman, permittivity

NM = np.array([450.0, 600.0, 800.0])
ANGLE = 65.0
GLASS, K, MM = 1.52, 4e-6, 0.01
ORDINARY, EXTRAORDINARY, DEPTH = 1.62, 1.78 + 0.03j, 180.0
TILT, AZIMUTH = 40.0, 25.0


def waves(n: complex, a: float) -> np.ndarray:
    """Fields of unit p and s waves, downwards and upwards, in an isotropic medium."""
    cosine = np.sqrt(1 - (a / n) ** 2 + 0j)
    return np.array([[cosine, 0, -cosine, 0], [n, 0, n, 0], [0, 1, 0, 1], [0, n * cosine, 0, -n * cosine]])


def sheet(n_above: complex, layers: list[Any], n_below: complex, a: float, nm: float) -> list[np.ndarray]:
    """Jones matrices r and t from above, r and t from below."""
    through = np.eye(4)
    for e, d in layers:
        through = through @ expm(-2j * np.pi * d / nm * berreman(e, a))
    T = np.linalg.solve(waves(n_above, a), through @ waves(n_below, a))
    t = np.linalg.inv(T[:2, :2])
    return [T[2:, :2] @ t, t, -t @ T[:2, 2:], T[2:, 2:] - T[2:, :2] @ t @ T[:2, 2:]]


def mueller(jones: np.ndarray) -> np.ndarray:
    return np.real(TO_STOKES @ np.kron(jones, jones.conj()) @ np.linalg.inv(TO_STOKES))


def averaged(nm: float, front: list[Any], back: list[Any], foot: complex, k: float = K) -> list[np.ndarray]:
    """Mueller matrices of reflection and transmission, the mean over the phase of the light in the plate."""
    a = np.sin(np.deg2rad(ANGLE))
    glass = GLASS + 1j * k
    r, t, r_below, t_below = sheet(1.0, front, glass, a, nm)
    back_r, back_t, *_ = sheet(glass, back, foot, a, nm)
    damping = np.exp(-2e6 * np.pi * np.sqrt(glass**2 - a**2).imag * MM / nm)
    # power of p and of s in the foot, for a unit field in air
    q = np.sqrt(foot**2 - a**2 + 0j)
    flux = np.diag(
        np.sqrt([np.real(foot**2 * q.conj()) / abs(foot) ** 2, q.real]) / np.cos(np.deg2rad(ANGLE)) ** 0.5
    )
    found = []
    for phase in np.arange(64) * 2 * np.pi / 64:
        one_way = damping * np.exp(1j * phase)
        inside = np.linalg.solve(np.eye(2) - one_way**2 * r_below @ back_r, t)
        found.append(
            [mueller(r + t_below @ back_r @ inside * one_way**2), mueller(flux @ back_t @ inside * one_way)]
        )
    return list(np.mean(found, axis=0))


FRONT = [(permittivity((ORDINARY, EXTRAORDINARY), TILT, AZIMUTH), DEPTH)]
TILTED = pl.Anisotropic(ORDINARY, EXTRAORDINARY, axis=(TILT, AZIMUTH))
PLATE = pl.Substrate(pl.dispersion.Constant(GLASS, K), back=1.0, plate_mm=MM)


def simulator(scene: pl.Scene) -> Any:
    scene = with_wavelength(scene, NM, ANGLE)
    run = build(pl.plan(scene))
    return jax.jit(lambda x: run(insert(scene, list(x)))), np.array(start_values(scene))


def simulated(scene: pl.Scene) -> np.ndarray:
    run, start = simulator(scene)
    return np.asarray(run(start))


def expected(signal: str, matrices: list[list[np.ndarray]]) -> np.ndarray:
    """A signal of p-polarised light, or of ellipsometry, from Mueller matrices of reflection and passage."""
    R, T = (np.array(x) for x in zip(*matrices, strict=True))
    if signal == "mueller":
        return (R / R[:, :1, :1]).reshape(-1, 16)[:, 1:].ravel()
    if signal == "psi-delta":
        rows = [-R[:, 0, 1] - R[:, 1, 0], R[:, 2, 2] + R[:, 3, 3], R[:, 2, 3] - R[:, 3, 2]]
        return (np.array(rows) / (R[:, 0, 0] + R[:, 1, 1])).T.ravel()
    power = R if signal == "R" else T
    return power[:, 0, 0] + power[:, 0, 1]


def light(signal: str) -> pl.Light:
    return pl.Light(signal=signal, angle=ANGLE, polarisation="p" if signal in "RT" else "unpolarised")


SLOW = pytest.mark.slow  # 2 s of compilation each


@pytest.mark.parametrize(
    "signal", ["mueller", *(pytest.param(x, marks=SLOW) for x in ("R", "T", "psi-delta"))]
)
def test_film_on_a_plate(signal):
    found = simulated(pl.Scene(pl.Layer(TILTED, DEPTH), PLATE, light=light(signal)))
    exact = expected(signal, [averaged(nm, FRONT, [], 1.0) for nm in NM])
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12)


@pytest.mark.slow  # 5 s of compilation
@pytest.mark.parametrize("signal", ["T", "mueller"])
def test_films_on_both_faces(signal):
    """A film of three indices, and one that absorbs, on silicon: a bonded plate."""
    x, y, z = 1.5, 1.6, 1.7 + 0.1j
    turned = pl.Anisotropic(x=x, y=y, z=z, axis=(30.0, 60.0, 20.0))
    layers = [pl.Layer(TILTED, DEPTH), pl.Layer(1.46, 95.0), pl.Plate(pl.dispersion.Constant(GLASS, K), MM)]
    found = simulated(pl.Scene([*layers, pl.Layer(turned, 70.0)], 3.9 + 0.02j, light=light(signal)))
    front, back = [*FRONT, (np.eye(3) * 1.46**2, 95.0)], [(permittivity((x, y, z), 30.0, 60.0, 20.0), 70.0)]
    exact = expected(signal, [averaged(nm, front, back, 3.9 + 0.02j) for nm in NM])
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12)


@pytest.mark.slow  # 10 s of compilation
def test_slope_is_that_of_differences():
    extraordinary = pl.dispersion.Constant(pl.Free(1.5, 2, start=1.78), pl.Free(0, 0.1, start=0.03))
    film = pl.Anisotropic(
        ORDINARY, extraordinary, axis=(pl.Free(0, 90, start=40.0), pl.Free(0, 90, start=25.0))
    )
    run, start = simulator(
        pl.Scene(pl.Layer(film, pl.Free(10, 500, start=DEPTH)), PLATE, light=light("mueller"))
    )
    slope = np.asarray(jax.jit(jax.jacfwd(run))(start))

    def signal(x: np.ndarray) -> np.ndarray:
        n, k, theta, phi, depth = x
        front = [(permittivity((ORDINARY, n + 1j * k), theta, phi), depth)]
        return expected("mueller", [averaged(nm, front, [], 1.0) for nm in NM])

    for i, step in enumerate(np.diag([1e-4, 1e-4, 1e-2, 1e-2, 1e-2])):
        # fourth order
        near, far = (signal(start + m * step) - signal(start - m * step) for m in (1, 2))
        difference = (8 * near - far) / (12 * step[i])
        np.testing.assert_allclose(
            slope[:, i], difference, rtol=0, atol=1e-8 * np.max(np.abs(difference)) + 1e-10
        )


@SLOW
@pytest.mark.parametrize("theta", [0, 90])
def test_aligned_absorbing_film_on_a_plate(theta):
    """Ψ and Δ contain the phase between s and p of the light that crossed the film."""
    film = pl.Anisotropic(ORDINARY, EXTRAORDINARY, axis=(theta, 0))
    found = simulated(pl.Scene(pl.Layer(film, DEPTH), PLATE, light=light("psi-delta")))
    front = [(permittivity((ORDINARY, EXTRAORDINARY), theta, 0.0), DEPTH)]
    exact = expected("psi-delta", [averaged(nm, front, [], 1.0) for nm in NM])
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12)


@SLOW
@pytest.mark.parametrize("part", [{"back_collected": 0.3}, {"back_reflections": 2, "back_collected": 0.5}])
@pytest.mark.parametrize("signal", ["R", "T"])
def test_part_of_the_light_from_the_back_face(signal, part):
    """As the sums over orders of s and p alone, where the axis is the normal but may tilt."""
    plate = pl.Substrate(GLASS, back=1.0, **part)
    both = [
        simulated(pl.Scene(pl.Layer(pl.Anisotropic(1.6, 1.9, axis=axis), DEPTH), plate, light=light(signal)))
        for axis in ((0.0, 0.0), (1e-9, 0.0))
    ]
    np.testing.assert_allclose(both[1], both[0], rtol=0, atol=1e-9)
