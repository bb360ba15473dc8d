"""Film formulas of renderers against their published codes, renders of Blender, and Airy's formula."""

import math

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import film_colour
from pellicle.colour.bands import published_gaussians
from pellicle.colour.film import reflectance
from pellicle.colour.observers import columns
from pellicle.optics.pair import Pair
from pellicle.rendering import gltf, materialx
from pellicle.rendering.appearance import ANGLES, appearance
from pellicle.rendering.blender import DIELECTRIC, METAL, cycles_formula, film
from pellicle.rendering.formula import effective, error, physical
from pellicle.rendering.gltf import GLTF
from pellicle.rendering.materialx import artistic_colours, artistic_index
from tests.airy import airy

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
    numbers = {"ior": index, "base": np.array(base), "factor": 1.0}
    found = GLTF.colour(numbers, np.array(thickness), cosine)
    np.testing.assert_allclose(found, [published(index, thickness, x, base) for x in cosine], atol=1e-12)
    guarded = [published(index, thickness, x, [min(f0, 0.9998) + 1e-4 for f0 in base]) for x in cosine]
    np.testing.assert_allclose(
        gltf.GLTF_GUARDED.colour(numbers, np.array(thickness), cosine), guarded, atol=1e-12
    )


@pytest.mark.slow  # compiles for 2 s
def test_without_a_film_the_base_is_left():
    """At thickness 0 and normal incidence a base of F0 reflects F0."""
    base = np.array([0.3, 0.5, 0.7])
    bare = gltf.film(1.8, gltf.base_index(base), np.array([0.0]), np.array([1.0]))
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


@pytest.mark.slow  # solves for 6 s
def test_solved_numbers_are_nearer(steel):
    """Without the base's extinction glTF's steel is off by tens; solved numbers leave a few."""
    look, as_is, solved = steel
    assert as_is.scale == 1.0
    assert as_is.error.mean > 20
    assert solved.error.mean < 0.1 * as_is.error.mean
    assert error(GLTF, look, solved.numbers, solved.scale) == solved.error
    for key in GLTF.keys:
        assert np.all((solved.numbers[key.name] >= key.lower) & (solved.numbers[key.name] <= key.upper))


DEGREES = np.array([0.0, 30.0, 50.0, 60.0, 75.0, 80.0])
COSINES = np.cos(np.deg2rad(DEGREES))
conductor = jax.jit(materialx.conductor)
schlick = jax.jit(materialx.schlick)


@pytest.mark.slow  # compiles for 3 s
@pytest.mark.parametrize(
    ("ior", "base", "thickness"),
    [(1.33, 1.0, 300.0), (1.5, 1.33, 400.0), (1.46, 4.0 + 0.1j, 300.0), (2.4, 2.7 + 2.8j, 40.0)],
)
def test_a_grey_base_is_exact(ior, base, thickness):
    """With the same n and k in all channels nothing but two orders and four Gaussians is approximate.

    The published Gaussians sum to 1.0011 in Z, and MaterialX takes 1 for the mean colour.
    """
    bands = published_gaussians()._replace(orders=2)
    exact = np.asarray(reflectance(thickness, ior, base, bands, angle=DEGREES)) @ bands.weights
    n, k = np.full(3, np.real(base)), np.full(3, np.imag(base))
    found = conductor({"ior": ior, "n": n, "k": k}, np.array(thickness), COSINES)
    np.testing.assert_allclose(found, np.clip(exact @ materialx.XYZ_TO_RGB.T, 0, 1), atol=1.2e-3)


@pytest.mark.slow
def test_a_tint_multiplies_the_dielectric():
    grey = {"ior": 1.5, "n": np.full(3, 1.33), "k": np.zeros(3)}
    white = conductor(grey, np.array(400.0), COSINES)
    tint = np.array([0.2, 0.5, 1.0])
    found = materialx.dielectric({"ior": 1.5, "base": 1.33, "tint": tint}, np.array(400.0), COSINES)
    np.testing.assert_allclose(found, white * tint, atol=1e-12)


def published_metal(ior, thickness, cosine, normal, edge):
    """`mx_fresnel_airy` with the Schlick model, written out; linear RGB before the clamp at 1."""

    def hoffman(x, f0, f82):
        at = 1 / 7
        a = (f0 + (1 - f0) * (1 - at) ** 5) * (1 - f82) / (at * (1 - at) ** 6)
        return f0 + (1 - f0) * (1 - x) ** 5 - a * x * (1 - x) ** 6

    val, pos = [5.4856e-13, 4.4201e-13, 5.2481e-13], [1.6810e6, 1.7953e6, 2.2084e6]
    var = [4.3278e9, 9.3046e9, 6.6121e9]
    inside = math.sqrt(1 - (1 - cosine**2) / ior**2)
    xyz = [0.0, 0.0, 0.0]
    rs = (cosine - ior * inside) / (cosine + ior * inside)
    rp = (ior * cosine - inside) / (ior * cosine + inside)
    for r12, turn in ((rp**2, 0.0 if cosine < math.cos(math.atan(ior)) else math.pi), (rs**2, math.pi)):
        for c in range(3):
            r23 = 0.5 * hoffman(inside, normal[c], edge[c])
            root = [math.sqrt(min(max(x, 0.01), 0.99)) for x in normal]
            shift = turn + (math.pi if (1 + root[c]) / (1 - root[c]) < ior else 0.0)
            total = (1 - r12) ** 2 * r23 / (1 - r12 * r23)
            xyz[c] += 0.5 * (r12 + total)
            term = total - (1 - r12)
            for m in (1, 2):
                term *= math.sqrt(r12 * r23)
                phase = 2 * math.pi * m * 2 * ior * inside * thickness * 1e-9
                wave = val[c] * math.sqrt(2 * math.pi * var[c])
                wave *= math.cos(pos[c] * phase + m * shift) * math.exp(-var[c] * phase**2)
                if c == 0:
                    lobe = 9.7470e-14 * math.sqrt(2 * math.pi * 4.5282e9) * math.exp(-4.5282e9 * phase**2)
                    wave += lobe * math.cos(2.2399e6 * phase + m * shift)
                xyz[c] += 0.5 * term * 2 * wave / 1.0685e-7
    # columns as in GLSL
    columns = (2.3706743, -0.5138850, 0.0052982), (-0.9000405, 1.4253036, -0.0146949)
    columns += ((-0.4706338, 0.0885814, 1.0093968),)
    return [sum(columns[j][i] * xyz[j] for j in range(3)) for i in range(3)]


def test_a_metal_of_open_pbr_is_the_published_one():
    normal, edge = np.array([0.6, 0.3, 0.05]), np.array([0.9, 1.0, 0.4])
    numbers = {"ior": 2.0, "base": normal, "edge": edge, "weight": 1.0}
    found = schlick(numbers, np.array(150.0), COSINES)
    expected = [published_metal(2.0, 150.0, x, normal, edge) for x in COSINES]
    np.testing.assert_allclose(found, np.clip(expected, 0, 1), atol=1e-6)
    bare = schlick({**numbers, "weight": 0.0}, np.array(150.0), np.array([1.0, 1 / 7]))
    at_82 = (normal + (1 - normal) * (6 / 7) ** 5) * edge
    np.testing.assert_allclose(bare, [normal, at_82], atol=1e-12)


def test_standard_surface_has_the_same_metal():
    """Two colours hold n and k of a metal whose k is large enough, and clip others."""
    n, k = np.array([0.3, 2.4, 1.5]), np.array([3.0, 2.6, 2.0])
    colours = artistic_colours(n, k)
    np.testing.assert_allclose(artistic_index(*colours), (n, k), rtol=1e-9)
    assert all(np.all((x >= 0) & (x <= 1)) for x in colours)


COMPILED = jax.jit(film)
SKY_COSINES = np.cos(np.deg2rad([0.0, 45.0, 75.0]))
RENDERED = [
    # film nm, index, base, linear sRGB at 0, 45 and 75 degrees
    (
        *(120.0, 2.4, [2.9 + 3.1j, 2.6 + 2.8j, 2.3 + 2.4j]),
        [[0.591302, 0.440668, 0.00875], [0.579305, 0.493747, 0.091477], [0.483693, 0.500722, 0.434263]],
    ),
    (
        *(900.0, 1.46, [3.8 + 0.02j, 4.1 + 0.04j, 4.7 + 0.15j]),
        [[0.168069, 0.255943, 0.312486], [0.272315, 0.258375, 0.330031], [0.357032, 0.344012, 0.384984]],
    ),
    (
        *(400.0, 1.33, [1.0, 1.0, 1.0]),
        [[0.053656, 0.000442, 0.064029], [0.107403, 0.078, 0.0], [0.246283, 0.498846, 0.500458]],
    ),
    (
        *(0.6, 2.0, [1.5, 1.5, 1.5]),
        [[0.040039, 0.040054, 0.040083], [0.050278, 0.050292, 0.050319], [0.253101, 0.253115, 0.253142]],
    ),
]
"""Smooth squares under a white sky, rendered by bpy 5.0.1 in float32: Metallic BSDF, and Principled without
transmission on a black base."""


def seen(nm, index, base):
    base = Pair(np.real(base), np.imag(base))
    with jax.enable_x64(True):
        return np.asarray(COMPILED(np.asarray(index), base, np.full(3, nm), SKY_COSINES))


@pytest.mark.parametrize(("nm", "index", "base", "rgb"), RENDERED)
def test_renders_of_blender(nm, index, base, rgb):
    np.testing.assert_allclose(seen(nm, index, base), rgb, atol=2e-6)


def test_weak_interference_is_the_integral_over_the_spectrum():
    """Airy's formula in complex numbers, weighted by red, green and blue in white of equal energy."""
    table = columns("observers.csv")
    weights = np.stack([table[f"{axis}_1931"] for axis in "xyz"], axis=1) @ np.transpose(TO_REC709)
    exact = airy(table["wavelength_nm"], 250.0, 1.8, 1.5, SKY_COSINES[:, None])
    expected = exact @ (weights / weights.sum(axis=0))
    np.testing.assert_allclose(seen(250.0, 1.8, [1.5] * 3), expected, atol=2e-3)  # interpolated table


@pytest.fixture(scope="module")
def iron():
    return appearance(pl.Scene(pl.Layer(2.9, 40.0), pl.material("Fe")))


@pytest.mark.slow  # solves for 3 s; the other formulas are solved in the same way
def test_solved_numbers_come_closer(iron):
    assert cycles_formula(iron) is METAL
    own, solved = physical(METAL, iron), effective(METAL, iron)
    np.testing.assert_allclose(own.numbers["base_extinction"], iron.base.imag)
    assert solved.error.mean < 0.5 * own.error.mean
    assert solved.error.mean <= solved.error.largest


@pytest.mark.slow  # compiles for 2 s
def test_a_transparent_base_has_one_index():
    look = appearance(pl.Scene(pl.Layer(1.47, 400.0), 1.52))
    assert cycles_formula(look) is DIELECTRIC
    assert physical(DIELECTRIC, look).numbers == {"ior": 1.47, "base_ior": 1.52}
