"""Depolarisation by every effect that adds intensities, against sums of Mueller matrices of the package tmm.

Orders between the faces of plates are in `test_plates` and `test_back_collected`: the length of their N, C, S
is what depolarisation leaves.
"""

import numpy as np
import pytest
import tmm

import pellicle as pl
from tests.forward_model.test_plates import ANGLE, GLASS, NM, TO_STOKES, ncs

FILM, DEPTH, BULK = 1.46, 1000.0, 3.9 + 0.02j
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
FWHM = 2 * np.sqrt(2 * np.log(2))


def jones(angle: float, nm: float, depth: float = DEPTH) -> np.ndarray:
    """r_p and r_s."""
    return np.array([tmm.coh_tmm(x, [1, FILM, BULK], [np.inf, depth, np.inf], angle, nm)["r"] for x in "ps"])


def mueller(matrix: np.ndarray) -> np.ndarray:
    return np.real(TO_STOKES @ np.kron(matrix, matrix.conj()) @ np.linalg.inv(TO_STOKES))


def depolarisation(matrix: np.ndarray) -> float:
    return 1 - np.sum(ncs(matrix) ** 2)


def averaged(rays) -> np.ndarray:
    """Depolarisation of summed Mueller matrices; `rays(nm)` are pairs of a weight and a Jones matrix."""
    return np.array([depolarisation(sum(w * mueller(m) for w, m in rays(nm))) for nm in NM])


def simulated(**instrument) -> np.ndarray:
    light = pl.Light(signal="psi-delta", angle=ANGLE)
    scene = pl.Scene(pl.Layer(FILM, DEPTH), BULK, light=light, instrument=pl.Instrument(**instrument))
    found = pl.simulate(scene, NM)
    assert found.depolarisation_sigma is None
    return found.depolarisation


def test_a_thickness_spread():
    def rays(nm):
        axis = np.deg2rad(ANGLE)
        return [(w, np.diag(jones(axis, nm, DEPTH + 8 * x))) for x, w in zip(NODES, WEIGHTS, strict=True)]

    truth = averaged(rays)
    assert truth.max() > 0.02
    np.testing.assert_allclose(simulated(thickness_spread=8.0), truth, atol=1e-6)


def test_a_bandwidth():
    def rays(nm):
        axis = np.deg2rad(ANGLE)
        return [(w, np.diag(jones(axis, nm + 6 / FWHM * x))) for x, w in zip(NODES, WEIGHTS, strict=True)]

    truth = averaged(rays)
    assert truth.max() > 0.005
    np.testing.assert_allclose(simulated(bandwidth=6.0), truth, atol=1e-6)


def turned(axis: np.ndarray, radius: float, azimuth: float) -> tuple[np.ndarray, np.ndarray]:
    """Direction of a ray behind an aplanatic lens, and p and s of its light before the lens turned with it.

    Source: B. Richards and E. Wolf, Proc. R. Soc. A 253, 358 (1959).
    """
    s = np.array([0.0, 1.0, 0.0])
    p = np.cross(s, axis)
    outward = np.cos(azimuth) * p + np.sin(azimuth) * s
    around = np.sqrt(1 - radius**2)
    ray = around * axis + radius * outward

    def follow(field):
        part = field @ outward
        return field + part * ((around - 1) * outward - radius * axis)

    return ray, np.array([follow(p), follow(s)])


def matrix_of(radius: float, azimuth: float, nm: float) -> np.ndarray:
    """Jones matrix of a ray in the frames of both lenses, with the turn of its plane of incidence."""
    sine, cosine = np.sin(np.deg2rad(ANGLE)), np.cos(np.deg2rad(ANGLE))
    ray, before = turned(np.array([sine, 0, -cosine]), radius, azimuth)
    # the lens behind the sample is the mirror image, with p = s × k in both
    mirror = np.array([1.0, 1.0, -1.0])
    behind = np.array([[-1.0], [1.0]]) * before * mirror
    reflected = ray * mirror
    s = np.cross([0.0, 0.0, 1.0], ray)
    s = s / np.linalg.norm(s)
    enters = np.array([np.cross(s, ray), s]) @ before.T
    leaves = np.array([np.cross(s, reflected), s]) @ behind.T
    return leaves.T @ np.diag(jones(np.arccos(-ray[2]), nm)) @ enters


def cone(half_angle: float):
    """Weights and Jones matrices of 140 rays, as a function of the wavelength."""
    nodes, weights = np.polynomial.legendre.leggauss(7)
    radii = np.sqrt(0.5 * (nodes + 1)) * np.sin(np.deg2rad(half_angle))
    azimuths = np.pi * (np.arange(20) + 0.5) / 10

    def rays(nm):
        return [(w, matrix_of(r, a, nm)) for r, w in zip(radii, weights, strict=True) for a in azimuths]

    return rays


@pytest.mark.parametrize("half_angle", [1.0, 3.0])
def test_a_cone_of_light(half_angle):
    np.testing.assert_allclose(simulated(angle_spread=half_angle), averaged(cone(half_angle)), atol=1e-6)


def test_the_mueller_matrix_of_a_cone_of_light():
    """Mirror images of a ray cancel what mixes s and p; m22 and m44 differ from 1 and m33."""
    truth = [sum(w * mueller(m) for w, m in cone(3.0)(nm)) for nm in NM]
    light = pl.Light(signal="mueller", angle=ANGLE)
    scene = pl.Scene(pl.Layer(FILM, DEPTH), BULK, light=light, instrument=pl.Instrument(angle_spread=3.0))
    found = np.concatenate([np.ones((len(NM), 1)), pl.simulate(scene, NM).values], axis=1)
    signs = np.outer([1, 1, 1, -1], [1, 1, 1, -1])  # of the fourth Stokes parameter: see `ncs`
    expected = np.array([signs * matrix / matrix[0, 0] for matrix in truth])
    np.testing.assert_allclose(found.reshape(-1, 4, 4), expected, atol=1e-6)
    assert np.min(1 - expected[:, 1, 1]) > 1e-4


def test_nothing_depolarises():
    light = pl.Light(signal="psi-delta", angle=ANGLE)
    scene = pl.Scene(pl.Layer(FILM, DEPTH), BULK, light=light)
    assert pl.simulate(scene, NM).depolarisation is None
    np.testing.assert_allclose(pl.simulate(scene, NM, depolarisation_noise=0.0).depolarisation, 0, atol=1e-14)
    taped = pl.Substrate(GLASS, back=1.0, back_collected=0.0)
    assert pl.simulate(pl.Scene(pl.Layer(FILM, DEPTH), taped, light=light), NM).depolarisation is None
    reflected = pl.Scene(pl.Layer(FILM, DEPTH), pl.Substrate(GLASS, back=1.0))
    assert pl.simulate(reflected, NM).depolarisation is None
