"""Films whose optic axis is tilted in a cone of light, against sums over 640 rays in fixed axes."""

from typing import Any

import numpy as np
import pytest

import pellicle as pl
from pellicle.effects import presence
from pellicle.effects.averaging import angle_spread
from pellicle.effects.film_plan import exact
from pellicle.effects.presence import anisotropy
from pellicle.errors import UsageError
from pellicle.forward_model.film_signal import build
from pellicle.forward_model.plan import Row
from pellicle.scene.film import with_wavelength
from pellicle.scene.free import insert, start_values

from .. import films
from ..differences import jacobian, with_slopes
from ..optics.lens_reference import Plate, muellers, permittivity

SIGNAL = "generalised-psi-delta"

NM = np.array([450.0, 600.0])
ORDINARY, EXTRAORDINARY, DEPTH, AXIS = 1.62, 1.78, 240.0, (40.0, 25.0)
COUNT = (16, 40)


def scene(
    signal: str = "R",
    medium: Any = None,
    foot: Any = 3.9 + 0.02j,
    depth: Any = DEPTH,
    angle: Any = 0.0,
    half: Any = 20.0,
    polarisation: str = "unpolarised",
    **more: Any,
) -> pl.Scene:
    medium = pl.Anisotropic(ORDINARY, EXTRAORDINARY, axis=AXIS) if medium is None else medium
    light = pl.Light(angle=angle, signal=signal, polarisation=polarisation, azimuth=more.pop("azimuth", None))
    return pl.Scene(
        pl.Layer(medium, depth), foot, light=light, instrument=pl.Instrument(angle_spread=half, **more)
    )


def predict(scene: pl.Scene) -> np.ndarray:
    return films.predict(scene, NM).reshape(len(NM), -1)


def truth(angle: float, half: float, layers: list[Any], foot: complex) -> tuple[np.ndarray, np.ndarray]:
    """Mueller matrices (wavelengths, 4, 4) of reflection and transmission."""
    each = [muellers(angle, half, layers, foot, nm, COUNT) for nm in NM]
    return np.stack([r for r, _ in each]), np.stack([t for _, t in each])


FILM = [(permittivity((ORDINARY, EXTRAORDINARY), *AXIS), DEPTH)]
SLOW = pytest.mark.slow  # 2 to 5 s of compilation each


def of(matrix: np.ndarray, polarisation: str) -> np.ndarray:
    sign = {"p": 1, "s": -1, "unpolarised": 0}[polarisation]
    return matrix[:, 0, 0] + sign * matrix[:, 0, 1]


@pytest.mark.parametrize(
    ("signal", "polarisation", "angle", "half"),
    [
        ("R", "p", 0.0, 20.0),
        pytest.param("R", "unpolarised", 0.0, 50.0, marks=SLOW),
        pytest.param("R", "s", 55.0, 8.0, marks=SLOW),
        pytest.param("T", "unpolarised", 0.0, 30.0, marks=SLOW),
        pytest.param("T", "p", 55.0, 8.0, marks=SLOW),
    ],
)
def test_intensities(signal, polarisation, angle, half):
    foot = 1.52 if signal == "T" else 3.9 + 0.02j
    found = predict(scene(signal, foot=foot, angle=angle, half=half, polarisation=polarisation))[:, 0]
    both = dict(zip("RT", truth(angle, half, FILM, foot), strict=True))
    np.testing.assert_allclose(found, of(both[signal], polarisation), atol=1e-6)
    bare = [muellers(angle, 0.01, FILM, foot, nm, (2, 4))["RT".index(signal)] for nm in NM]
    assert np.max(np.abs(found - of(np.stack(bare), polarisation))) > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("signal", "polarisation"), [("R", "s"), ("R", "p"), ("R", "unpolarised"), ("T", "p")]
)
def test_an_isotropic_film(signal, polarisation):
    thing = scene(signal, 1.7, foot=1.52, depth=900.0, angle=55.0, half=8.0, polarisation=polarisation)
    both = truth(55.0, 8.0, [(np.eye(3) * 1.7**2, 900.0)], 1.52)
    np.testing.assert_allclose(predict(thing)[:, 0], of(both["RT".index(signal)], polarisation), atol=1e-6)


@pytest.mark.slow  # compiles an absorbing biaxial film
def test_an_absorbing_biaxial_film_transmits_unlike_from_opposite_sides():
    """Reciprocity does not halve the rays of transmitted light."""
    indices, axis = (1.6, 1.7 + 0.05j, 1.8 + 0.02j), (40.0, 25.0, 60.0)
    x, y, z = indices
    medium = pl.Anisotropic(x=x, y=y, z=z, axis=axis)
    layers = [(permittivity(indices, *axis), 400.0)]
    found = predict(scene("T", medium, foot=1.52, depth=400.0, half=30.0, polarisation="s"))[:, 0]
    np.testing.assert_allclose(found, of(truth(0.0, 30.0, layers, 1.52)[1], "s"), atol=1e-6)


def ratios(m: np.ndarray) -> np.ndarray:
    """N, C, S of AnE, Aps and Asp, from coherencies of the elements (pp, ps, sp, ss) of a Jones matrix."""
    a = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, -1j, 1j, 0]])
    coherency = (np.linalg.inv(a) @ m @ a).reshape(-1, 2, 2, 2, 2)  # out, out*, in, in*
    rows = []
    for x, y in (((0, 0), (1, 1)), ((1, 0), (0, 0)), ((0, 1), (1, 1))):
        # conj(x) y, and both squares
        cross, xx, yy = (coherency[:, j[0], i[0], j[1], i[1]] for i, j in ((x, y), (x, x), (y, y)))
        total = (xx + yy).real
        rows += [(yy - xx).real / total, 2 * cross.real / total, 2 * cross.imag / total]
    return np.stack(rows, axis=1)


@pytest.mark.slow  # 5 s of compilation each
@pytest.mark.parametrize(("angle", "half"), [(65.0, 4.0), (10.0, 25.0), (0.0, 35.0)])
def test_ellipsometry(angle, half):
    r, _ = truth(angle, half, FILM, 3.9 + 0.02j)
    normalised = (r / r[:, :1, :1]).reshape(2, 16)[:, 1:]
    np.testing.assert_allclose(predict(scene("mueller", angle=angle, half=half)), normalised, atol=1e-6)
    np.testing.assert_allclose(predict(scene(SIGNAL, angle=angle, half=half)), ratios(r), atol=1e-6)
    np.testing.assert_allclose(
        predict(scene("psi-delta", angle=angle, half=half)), ratios(r)[:, :3], atol=1e-6
    )


@pytest.mark.slow  # 10 s of compilation each
@pytest.mark.parametrize("signal", ["R", "T", "mueller"])
def test_a_film_on_a_plate(signal):
    substrate = pl.Substrate(1.52, back=1.0)
    layers = [*FILM, Plate(1.52)]
    r, t = truth(50.0, 6.0, layers, 1.0)
    found = predict(scene(signal, foot=substrate, angle=50.0, half=6.0))
    expected = {"R": r[:, :1, 0], "T": t[:, :1, 0], "mueller": (r / r[:, :1, :1]).reshape(2, 16)[:, 1:]}
    np.testing.assert_allclose(found, expected[signal], atol=1e-6)


@pytest.mark.slow  # compiles derivatives of a cone
@pytest.mark.parametrize("angle", [0.0, 50.0])
def test_slopes_in_all_parameters(angle):
    medium = pl.Anisotropic(
        pl.dispersion.Constant(pl.Free(1.5, 1.7, start=1.62)),
        pl.dispersion.Constant(pl.Free(1.7, 1.9, start=1.78)),
        axis=(pl.Free(0, 90, start=40), pl.Free(0, 90, start=25)),
    )
    depth, half = pl.Free(100, 300, start=240), pl.Free(0, 20, start=8.0)
    free = pl.Free(angle - 20, angle + 20, start=angle) if angle else 0.0
    given = with_wavelength(scene("mueller", medium, depth=depth, angle=free, half=half), NM)
    model = with_slopes(lambda x: build(exact(given))(insert(given, x)))
    at = start_values(given)
    numeric = jacobian(lambda x: model(x)[1], at, np.maximum(np.abs(at), 1.0) * 1e-5)
    np.testing.assert_allclose(model(at)[0], numeric, rtol=1e-6, atol=1e-7)
    # without a cone its slope is 0
    point = np.asarray(model(np.array([*at[:-1], 0.0]))[0])
    assert np.all(np.isfinite(point))
    np.testing.assert_allclose(point[:, -1], 0.0, atol=1e-10)


def cone(**given: Any) -> Row:
    return angle_spread(with_wavelength(scene(**given), NM))


def test_plans():
    tilted = cone()
    assert tilted.around % 2 == 1
    assert tilted.count * tilted.around > 1
    assert 0 < tilted.error_bound < 1e-6
    assert "each with its own plane of incidence" in tilted.why
    surface = anisotropy(with_wavelength(scene(medium=pl.Anisotropic(1.62, 1.78, axis=(90, 0))), NM))
    assert surface.why.startswith("the rays of the cone have different planes of incidence: s and p mix")
    assert not presence.polarisation(with_wavelength(scene(polarisation="p"), NM)).on
    # more rays where the film is thicker or the cone wider
    assert min(cone(depth=1000.0).count, cone(half=50.0).count) > tilted.count


def test_an_axis_along_the_normal_keeps_the_closed_forms():
    for medium in (1.6, pl.Anisotropic(1.62, 1.78)):
        assert anisotropy(with_wavelength(scene(medium=medium), NM)).count < 4
        assert cone(medium=medium).around == 1


def test_refusals():
    plate = pl.Substrate(pl.Anisotropic(1.6, 1.7, axis=(90, 0)), back=1.0)
    with pytest.raises(
        UsageError, match="in a cone of light the optic axis of an incoherent plate must be the"
    ):
        anisotropy(with_wavelength(scene(medium=1.5, foot=plate), NM))
    plate = pl.Substrate(pl.Anisotropic(1.6, 1.7), back=1.0)
    with pytest.raises(UsageError, match="a birefringent plate in a scene whose optic axis is tilted"):
        anisotropy(with_wavelength(scene(foot=plate), NM))
