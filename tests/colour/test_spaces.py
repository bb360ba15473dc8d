"""Colours outside sRGB keep luminance and hue; colours inside stay as they are."""

import numpy as np

from pellicle.colour.spaces import into_srgb, outside

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # IEC 61966-2-1


def test_luminance_and_hue_are_kept():
    rng = np.random.default_rng(0)
    linear = rng.uniform(-0.4, 1.4, (2000, 3))
    found = into_srgb(linear)
    assert found.min() >= 0
    assert found.max() <= 1
    grey = np.clip(linear @ LUMINANCE, 0, 1)
    np.testing.assert_allclose(found @ LUMINANCE, grey, atol=2e-4)  # their digits are rounded
    away, kept = linear - grey[:, None], found - grey[:, None]
    crossed = np.linalg.norm(np.cross(away, kept), axis=1)
    dull = (grey < 0.02) | (grey > 0.98)
    assert np.max(crossed[~dull]) < 1e-3  # both point the same way from grey
    assert np.all(np.sum(away * kept, axis=1)[~dull] >= 0)


def test_colours_inside_are_unchanged_and_others_reach_the_edge():
    inside = np.random.default_rng(1).uniform(0, 1, (100, 3))
    np.testing.assert_allclose(into_srgb(inside), inside, atol=1e-12)
    edge = into_srgb(np.array([[0.2, 0.6, -0.3], [1.5, 0.4, 0.2]]))
    np.testing.assert_allclose([edge[0].min(), edge[1].max()], [0, 1], atol=1e-12)
    np.testing.assert_array_equal(into_srgb(np.array([3.0, 2.0, 5.0])), 1.0)
    assert outside(np.array([[0.5, 0.5, -0.01], [1.0, 0.0, 0.2]])).tolist() == [True, False]
