"""Noise as users write it, and as standard deviations of samples."""

import numpy as np
import pytest

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.errors import UsageError
from pellicle.signals.limits import noise_level

RGB = BrdfSamples(*np.zeros((4, 3)), np.array([[1.0, 2, 4], [10, 20, 40], [0, 2, 4]]), ("R", "G", "B"))


@pytest.mark.parametrize(
    ("given", "value", "relative"),
    [(0.01, 0.01, False), ("0.01", 0.01, False), ("2 %", 0.02, True), ("0.5%", 0.005, True)],
)
def test_a_noise_is_a_number_or_a_share(given, value, relative):
    assert noise_level(given) == pytest.approx((value, relative))


@pytest.mark.parametrize("wrong", [0, -1, "-2 %", "two", "%", "nan", "inf", ""])
def test_a_wrong_noise_is_refused(wrong):
    with pytest.raises(UsageError, match="--noise must be a standard deviation above zero"):
        noise_level(wrong, "--noise")


def test_a_share_of_the_signal():
    data = RGB.with_noise("10 %")
    np.testing.assert_allclose(data.sigma[:2], 0.1 * RGB.values[:2])
    assert data.sigma[2, 0] == pytest.approx(0.1 * 1e-3 * 4)  # a thousandth of the median, not zero
    assert data.relative == (0.1, 0.1, 0.1)


def test_a_noise_for_each_channel():
    data = RGB.with_noise(["10 %", 0.5, "1 %"])
    np.testing.assert_allclose(data.sigma[1], [1.0, 0.5, 0.4])
    assert data.relative == (0.1, 0.0, 0.01)
    assert RGB.with_noise(0.5).relative is None
    with pytest.raises(UsageError, match="2 numbers for 3 channels"):
        RGB.with_noise([0.1, 0.2])
