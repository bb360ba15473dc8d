"""glTF's film formula against its published code, written out for one film and one angle."""

import math

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import film_colour
from pellicle.rendering import gltf
from pellicle.rendering.appearance import ANGLES, appearance
from pellicle.rendering.formula import effective, error, physical
from pellicle.rendering.gltf import GLTF

TO_REC709 = [
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
]


def published(index, thickness, cosine, base_f0):
    """KHR_materials_iridescence, implementation notes, in air."""

    def schlick(f0, x):
        return f0 + (1 - f0) * (1 - x) ** 5

    def sensitivity(opd, shift):
        phase = 2 * math.pi * opd * 1e-9
        val, pos = [5.4856e-13, 4.4201e-13, 5.2481e-13], [1.6810e6, 1.7953e6, 2.2084e6]
        var = [4.3278e9, 9.3046e9, 6.6121e9]
        xyz = [
            v * math.sqrt(2 * math.pi * s) * math.cos(p * phase + h) * math.exp(-(phase**2) * s)
            for v, p, s, h in zip(val, pos, var, shift, strict=True)
        ]
        blue = math.sqrt(2 * math.pi * 4.5282e9) * math.cos(2.2399e6 * phase + shift[0])
        xyz[0] += 9.7470e-14 * blue * math.exp(-4.5282e9 * phase**2)
        return [sum(m * x / 1.0685e-7 for m, x in zip(row, xyz, strict=True)) for row in TO_REC709]

    inside = math.sqrt(1 - (1 - cosine**2) / index**2)
    r12 = schlick(((index - 1) / (index + 1)) ** 2, cosine)
    opd = 2 * index * thickness * inside
    result = []
    for channel in range(3):
        root = [math.sqrt(min(max(f0, 0), 0.9999)) for f0 in base_f0]
        base = [(1 + x) / (1 - x) for x in root]
        r23 = schlick(((base[channel] - index) / (base[channel] + index)) ** 2, inside)
        phi = [math.pi + (math.pi if n < index else 0.0) for n in base]
        r123 = min(max(r12 * r23, 1e-5), 0.9999)
        rs = (1 - r12) ** 2 * r23 / (1 - r123)
        total, cm = r12 + rs, rs - (1 - r12)
        for m in (1, 2):
            cm *= math.sqrt(r123)
            total += cm * 2 * sensitivity(m * opd, [m * x for x in phi])[channel]
        result.append(max(total, 0.0))
    return result


@pytest.mark.parametrize(
    ("index", "thickness", "base"),
    [(1.33, 300.0, (0.0, 0.0, 0.0)), (2.9, 40.0, (0.5, 0.45, 0.3)), (1.46, 900.0, (0.04, 0.1, 0.9))],
)
def test_the_formula_is_the_published_one(index, thickness, base):
    """Also where the base is below the film in index in one channel, above in another."""
    cosine = np.cos(np.deg2rad([0.0, 35.0, 79.0]))
    found = gltf.film(index, np.array(base), np.array(thickness), cosine)
    expected = [published(index, thickness, x, base) for x in cosine]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.slow  # compiles for 2 s
def test_without_a_film_the_base_is_left():
    """At thickness 0 and normal incidence a base of F0 reflects F0."""
    base = np.array([0.3, 0.5, 0.7])
    bare = gltf.film(1.8, base, np.array([0.0]), np.array([1.0]))
    np.testing.assert_allclose(bare[0], base, atol=0.006)  # the code's least product 1e-5 leaves a ripple
    half = gltf.colour({"ior": 1.8, "base": base, "factor": 0.0}, np.array([90.0]), np.array([1.0]))
    np.testing.assert_allclose(half[0], base, atol=1e-12)


@pytest.fixture(scope="module")
def steel():
    """An oxide of 40 nm on steel, and both sets of numbers."""
    look = appearance(pl.Scene(pl.Layer(2.9, 40.0), 2.7 + 2.8j))
    return look, physical(GLTF, look), effective(GLTF, look)


@pytest.mark.slow
def test_colours_are_exact(steel):
    """Against steps of 1 nm of the colour package."""
    look = steel[0]
    exact = film_colour(40.0, 2.9, 2.7 + 2.8j, angle=ANGLES[::20], method="uniform-351")
    assert look.xyz.shape == (1, 81, 3)
    np.testing.assert_allclose(look.xyz[0, ::20], exact.xyz, atol=1e-4)
    bare = ((2.7 - 1) ** 2 + 2.8**2) / ((2.7 + 1) ** 2 + 2.8**2)
    np.testing.assert_allclose(look.bare, bare, atol=2e-4)  # sRGB's matrix has four digits
    assert look.metallic


def test_solved_numbers_are_nearer(steel):
    """Without the base's extinction glTF's steel is off by tens; solved numbers leave a few."""
    look, as_is, solved = steel
    assert as_is.scale == 1.0
    assert as_is.error.mean > 20
    assert solved.error.mean < 0.1 * as_is.error.mean
    assert error(GLTF, look, solved.numbers, solved.scale) == solved.error
    for key in GLTF.keys:
        assert np.all((solved.numbers[key.name] >= key.lower) & (solved.numbers[key.name] <= key.upper))
