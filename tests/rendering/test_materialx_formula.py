"""MaterialX's film formula against Airy's series in pellicle's own optics, by the same Gaussians."""

import math

import jax
import numpy as np
import pytest

from pellicle.colour.bands import published_gaussians
from pellicle.colour.film import reflectance
from pellicle.rendering import materialx
from pellicle.rendering.materialx import artistic_colours, artistic_index

ANGLES = np.array([0.0, 30.0, 50.0, 60.0, 75.0, 80.0])
COSINES = np.cos(np.deg2rad(ANGLES))
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
    exact = np.asarray(reflectance(thickness, ior, base, bands, angle=ANGLES)) @ bands.weights
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
