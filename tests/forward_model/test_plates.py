"""Plates: orders of light between their faces add as Mueller matrices, all of them or a part of each."""

from collections.abc import Iterator
from dataclasses import replace

import jax
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.accuracy.case import case
from pellicle.accuracy.high_precision import signal
from pellicle.forward_model.film_signal import build
from pellicle.recipes.read import read_recipe
from pellicle.scene.film import with_wavelength
from pellicle.scene.free import insert

from ..differences import derivative
from ..films import predict

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


def matrices(front, depths, back, back_depths) -> Iterator[np.ndarray]:
    """Mueller matrices at NM. The plate absorbs on the way, but its faces are those of a clear one."""
    angle = np.deg2rad(ANGLE)
    inside = tmm.snell(1.0, GLASS, angle)
    for nm in NM:
        passed = np.exp(-4e6 * np.pi * K * MM / np.real(np.cos(inside)) / nm)
        upper = sheet([1.0, *front, GLASS], depths, angle, nm)
        yield on_a_plate(upper, sheet([GLASS, *back], back_depths, inside, nm)[0], passed)


def expected(*plate) -> np.ndarray:
    return np.array([ncs(matrix) for matrix in matrices(*plate)])


def simulated(scene: pl.Scene) -> np.ndarray:
    return predict(scene, NM, ANGLE).reshape(-1, 3)


LIGHT = pl.Light(signal="psi-delta", angle=ANGLE)
PLATE = pl.Substrate(pl.dispersion.Constant(GLASS, K), back=1.0, plate_mm=MM)


@pytest.mark.parametrize("index", [1.46, 2.2 + 0.05j])
def test_a_film_on_a_plate(index):
    found = simulated(pl.Scene(pl.Layer(index, 120.0), PLATE, light=LIGHT))
    np.testing.assert_allclose(found, expected([index], [120.0], [1.0], []), rtol=0, atol=5e-8)
    assert np.all(np.linalg.norm(found, axis=1) < 0.998)  # part of the light is not polarised


def test_films_on_both_faces():
    layers = [pl.Layer(2.1, 80.0), pl.Layer(1.46, 95.0), pl.Plate(pl.dispersion.Constant(GLASS, K), MM)]
    layers.append(pl.Layer(1.38, 110.0))
    found = simulated(pl.Scene(layers, 3.9 + 0.02j, light=LIGHT))
    exact = expected([2.1, 1.46], [80.0, 95.0], [1.38, 3.9 + 0.02j], [110.0])
    np.testing.assert_allclose(found, exact, rtol=0, atol=5e-8)


def test_the_whole_matrix():
    """All 16 elements; tmm's conjugate amplitudes have the opposite sign of the fourth Stokes parameter."""
    light = pl.Light(signal="mueller", angle=ANGLE)
    scene = pl.Scene(pl.Layer(2.2 + 0.05j, 120.0), PLATE, light=light)
    found, signs = predict(scene, NM, ANGLE).reshape(-1, 15), np.diag([1, 1, 1, -1])
    for elements, matrix in zip(found, matrices([2.2 + 0.05j], [120.0], [1.0], []), strict=True):
        exact = (signs @ matrix @ signs / matrix[0, 0]).ravel()[1:]
        np.testing.assert_allclose(elements, exact, rtol=0, atol=5e-8)


def test_behind_a_metal_nothing_comes_back():
    """The plate is then a half space."""
    with_back, without = (
        simulated(pl.Scene(pl.Layer(0.2 + 3.4j, 400.0), substrate, light=LIGHT))
        for substrate in (PLATE, pl.dispersion.Constant(GLASS, K))
    )
    np.testing.assert_allclose(with_back, without, rtol=0, atol=1e-9)


FILM, DEPTH, BEHIND = 2.2 + 0.05j, 120.0, 0.9 + 6.0j
"""A metal behind the plate: each order is a large part of the one before it."""


def plate(**part) -> pl.Substrate:
    return pl.Substrate(pl.dispersion.Constant(GLASS, K), back=BEHIND, plate_mm=MM, **part)


def scene(kind: str, substrate: pl.Substrate, *above: pl.Plate) -> pl.Scene:
    light = LIGHT if kind == "psi-delta" else pl.Light(signal=kind, angle=ANGLE)
    return with_wavelength(pl.Scene([*above, pl.Layer(FILM, DEPTH)], substrate, light=light), NM, ANGLE)


def collected(kind: str, **part) -> np.ndarray:
    return predict(scene(kind, plate(**part))).reshape(3, -1).squeeze()


def orders(kind: str, share: float, reflections: int | None) -> np.ndarray:
    """Mueller matrices of each order, by the package tmm, added one after the other."""
    found = []
    for nm in NM:
        angle = np.deg2rad(ANGLE)
        cosine = np.sqrt(1 - (np.sin(angle) / GLASS) ** 2)
        passed = np.exp(-4e6 * np.pi * K * MM / cosine / nm)
        r, t, r_below, t_below = sheet([1.0, FILM, GLASS], [DEPTH], angle, nm)
        back = sheet([GLASS, BEHIND], [], np.arcsin(np.sin(angle) / GLASS), nm)[0]
        total, inside = r, passed * t
        for _ in range(400 if reflections is None else reflections):
            inside = passed * back @ inside
            total = total + share * t_below @ inside
            inside = passed * r_below @ inside
        found.append(total[0, 0] if kind == "R" else ncs(total))
    return np.array(found)


@pytest.mark.parametrize("kind", ["R", "psi-delta"])
@pytest.mark.parametrize(("share", "reflections"), [(0.4, None), (1.0, 1), (0.7, 3)])
def test_each_order_is_added_up_to_the_last(kind, share, reflections):
    found = collected(kind, back_collected=share, back_reflections=reflections)
    np.testing.assert_allclose(found, orders(kind, share, reflections), rtol=0, atol=5e-8)
    assert np.abs(found - collected(kind)).max() > 1e-3


@pytest.mark.slow
def test_the_limits():
    """All light, none, and a number of reflections beyond which nothing is left."""
    for kind in ("R", "psi-delta"):
        np.testing.assert_array_equal(collected(kind, back_collected=1.0), collected(kind))
        np.testing.assert_allclose(collected(kind, back_reflections=60), collected(kind), atol=1e-12)
        alone = predict(scene(kind, pl.Substrate(pl.dispersion.Constant(GLASS, K)))).reshape(3, -1).squeeze()
        np.testing.assert_array_equal(collected(kind, back_collected=0.0), alone)
        assert not pl.plan(scene(kind, plate(back_collected=0))).on("back-face")
    # of the transmitted light that which crosses the plate once is always there
    glass = pl.Substrate(GLASS, back=1.0)
    light = with_wavelength(pl.Scene(pl.Layer(FILM, DEPTH), glass, light=pl.Light(signal="T")), NM)

    def through(**part):
        return predict(replace(light, substrate=replace(glass, **part)))

    # T = t/(1 − x) and t(1 + c x/(1 − x)), so t and x follow from two of them
    whole, once, some = through(), through(back_collected=0.0), through(back_collected=0.4)
    np.testing.assert_allclose(some, once + 0.4 * (whole - once), rtol=1e-14)
    x = 1 - once / whole
    np.testing.assert_allclose(through(back_reflections=2), once * (1 + x + x**2), rtol=1e-13)


@pytest.mark.parametrize(
    ("kind", "share", "reflections"), [("R", 0.99, 2), ("T", 0.35, 2), ("psi-delta", 0.01, None)]
)
def test_fifty_digits(kind, share, reflections):
    """Value and slope in the share."""
    behind = pl.scene.layers.medium(1.33 if kind == "T" else BEHIND)
    substrate = plate(back_collected=pl.Free(0, 1, start=share), back_reflections=reflections)
    described = scene(kind, replace(substrate, back=behind))
    exact = case(replace(described, light=replace(described.light, angle=ANGLE)), NM)
    run = jax.jit(build(pl.plan(described)))
    value, slope = jax.jvp(lambda c: run(insert(described, [c])), (share,), (1.0,))

    def truth(share):
        return signal(exact, np.array([share]), np.arange(3)).ravel()

    # the faces of an absorbing plate are taken as those of a clear one, which is wrong by (k/n)² and k/n
    np.testing.assert_allclose(value, truth(share), rtol=0, atol=1e-7)
    np.testing.assert_allclose(slope, derivative(truth, share, 1e-4), rtol=1e-6, atol=1e-7)


def test_absent_it_costs_nothing():
    """All light collected is the program of a plate."""
    programs = set()
    for part in ({}, {"back_collected": 1.0}):
        described = scene("R", plate(**part))
        run = build(pl.plan(described).static_key)
        programs.add(jax.jit(run).lower(described).as_text())
    assert len(programs) == 1


def test_a_film_on_the_back():
    """The share is of all light from beneath the plate, the film there included."""
    light = pl.Light(angle=30.0, polarisation="s")
    found = {}
    for share in (0.0, 0.3, 1.0):
        layers = [pl.Layer(2.1, 80.0), pl.Plate(GLASS, MM, back_collected=share), pl.Layer(1.38, 110.0)]
        found[share] = predict(pl.Scene(layers, 3.9 + 0.02j, light=light), NM, 30.0)
    np.testing.assert_allclose(found[0.3], 0.7 * found[0.0] + 0.3 * found[1.0], rtol=1e-13)
    assert np.abs(found[1.0] - found[0.0]).min() > 1e-3


def test_the_plan_says_what_is_collected():
    def why(**part):
        return pl.plan(scene("R", plate(**part))).row("back-face").why

    assert "40 % of it is collected" in why(back_collected=0.4)
    assert "up to 1 reflection there counts" in why(back_reflections=1)
    assert "free" in why(back_collected=pl.Free(0, 1))
    assert "no light from the back face is collected" in why(back_collected=0)


def test_what_cannot_be_is_refused(refuses):
    for words, make in {
        "`back_collected` must be at most 1": lambda: plate(back_collected=1.2),
        "`back_collected` must not be negative": lambda: plate(back_collected=pl.Free(-0.1, 1)),
        "1 to 100, got 0": lambda: plate(back_reflections=0),
        "needs the medium behind the plate": lambda: pl.Substrate("BK7", back_collected=0.5),
        "'rough' is no medium": lambda: pl.Substrate("BK7", back="rough"),
        "one plate, and this one has 2": lambda: scene("R", plate(back_collected=0.5), pl.Plate("BK7", 1.0)),
    }.items():
        refuses(ValueError, words, make)


RECIPE = """
[data]
signal = "{signal}"
[scene]
substrate = {{ material = "BK7", {back} }}
[[scene.layer]]
material = "SiO2"
thickness = 100.0
"""


def test_a_recipe(write, refuses):
    def substrate(back: str, signal: str = "R") -> pl.Substrate:
        path = write(RECIPE.format(signal=signal, back=back), "film.toml")
        return read_recipe(path).scene().substrate

    some = substrate(
        'back = "air", back_collected = { lower = 0, upper = 1, value = 0.6 }, back_reflections = 3'
    )
    assert some.back_collected.start == 0.6
    assert some.back_reflections == 3
    for word in ("rough", "taped"):
        assert substrate(f'back = "{word}"').back_collected == 0.0
        refuses(pl.errors.DataError, "transmittance is not simulated", substrate, f'back = "{word}"', "T")
    with pytest.raises(pl.errors.DataError, match="leave out back_collected"):
        substrate('back = "rough", back_collected = 0.5')
