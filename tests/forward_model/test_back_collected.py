"""Back faces of plates of which only a part of the light is collected, order by order."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import case
from pellicle.accuracy.high_precision import signal
from pellicle.errors import UsageError
from pellicle.forward_model.film_signal import build
from pellicle.recipes.read import read_recipe
from pellicle.scene.film import with_wavelength
from pellicle.scene.free import insert

from .test_plates import ANGLE, GLASS, MM, NM, K, ncs, sheet
from .test_plates import LIGHT as ELLIPSOMETER

FILM, DEPTH, BEHIND = 2.2 + 0.05j, 120.0, 0.9 + 6.0j
"""A metal behind the plate: each order is a large part of the one before it."""


def plate(**part) -> pl.Substrate:
    return pl.Substrate(pl.dispersion.Constant(GLASS, K), back=BEHIND, plate_mm=MM, **part)


def scene(kind: str, substrate: pl.Substrate) -> pl.Scene:
    light = ELLIPSOMETER if kind == "psi-delta" else pl.Light(signal=kind, angle=ANGLE)
    return with_wavelength(pl.Scene(pl.Layer(FILM, DEPTH), substrate, light=light), NM, ANGLE)


def simulated(kind: str, **part) -> np.ndarray:
    described = scene(kind, plate(**part))
    return np.asarray(build(pl.plan(described))(described)).reshape(3, -1).squeeze()


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
    found = simulated(kind, back_collected=share, back_reflections=reflections)
    np.testing.assert_allclose(found, orders(kind, share, reflections), rtol=0, atol=5e-8)
    assert np.abs(found - simulated(kind)).max() > 1e-3


def test_the_limits():
    """All light, none, and a number of reflections beyond which nothing is left."""
    for kind in ("R", "psi-delta"):
        np.testing.assert_array_equal(simulated(kind, back_collected=1.0), simulated(kind))
        np.testing.assert_allclose(simulated(kind, back_reflections=60), simulated(kind), atol=1e-12)
        half_space = scene(kind, pl.Substrate(pl.dispersion.Constant(GLASS, K)))
        alone = np.asarray(build(pl.plan(half_space))(half_space)).reshape(3, -1).squeeze()
        np.testing.assert_array_equal(simulated(kind, back_collected=0.0), alone)
        assert not pl.plan(scene(kind, plate(back_collected=0))).on("back-face")
    # of the transmitted light that which crosses the plate once is always there
    glass = pl.Substrate(GLASS, back=1.0)
    light = with_wavelength(pl.Scene(pl.Layer(FILM, DEPTH), glass, light=pl.Light(signal="T")), NM)

    def through(**part):
        one = replace(light, substrate=replace(glass, **part))
        return np.asarray(build(pl.plan(one))(one))

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
    differences = (truth(share + 1e-4) - truth(share - 1e-4)) / 2e-4
    np.testing.assert_allclose(slope, differences, rtol=1e-6, atol=1e-7)


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
    layers = [pl.Layer(2.1, 80.0), pl.Plate(GLASS, MM, back_collected=0.3), pl.Layer(1.38, 110.0)]
    light = pl.Light(angle=30.0, polarisation="s")
    found = {}
    for share in (0.0, 0.3, 1.0):
        layers[1] = pl.Plate(GLASS, MM, back_collected=share)
        described = with_wavelength(pl.Scene(layers, 3.9 + 0.02j, light=light), NM, 30.0)
        found[share] = np.asarray(build(pl.plan(described))(described))
    np.testing.assert_allclose(found[0.3], 0.7 * found[0.0] + 0.3 * found[1.0], rtol=1e-13)
    assert np.abs(found[1.0] - found[0.0]).min() > 1e-3


def test_the_plan_says_what_is_collected():
    def why(**part):
        return pl.plan(scene("R", plate(**part))).row("back-face").why

    assert "40 % of it is collected" in why(back_collected=0.4)
    assert "up to 1 reflection there counts" in why(back_reflections=1)
    assert "free" in why(back_collected=pl.Free(0, 1))
    assert "no light from the back face is collected" in why(back_collected=0)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="`back_collected` must be at most 1"):
        plate(back_collected=1.2)
    with pytest.raises(ValueError, match="`back_collected` must not be negative"):
        plate(back_collected=pl.Free(-0.1, 1))
    with pytest.raises(ValueError, match="1 to 100, got 0"):
        plate(back_reflections=0)
    with pytest.raises(UsageError, match="needs the medium behind the plate"):
        pl.Substrate("BK7", back_collected=0.5)
    with pytest.raises(UsageError, match="'rough' is no medium"):
        pl.Substrate("BK7", back="rough")
    with pytest.raises(ValueError, match="one plate, and this one has 2"):
        pl.Scene([pl.Plate("BK7", 1.0), pl.Layer("SiO2", 9.0)], plate(back_collected=0.5))


RECIPE = """
[data]
signal = "{signal}"
[scene]
substrate = {{ material = "BK7", {back} }}
[[scene.layer]]
material = "SiO2"
thickness = 100.0
"""


def test_a_recipe(write):
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
        with pytest.raises(pl.errors.DataError, match="transmittance is not simulated"):
            substrate(f'back = "{word}"', "T")
    with pytest.raises(pl.errors.DataError, match="leave out back_collected"):
        substrate('back = "rough", back_collected = 0.5')
