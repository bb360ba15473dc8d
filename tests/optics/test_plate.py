"""A thick plate: intensities, not amplitudes, add between its faces."""

import numpy as np
import pytest

from pellicle.optics import plate


def test_the_bounces_are_summed():
    front, back, passed, internal = plate.Face(0.2, 0.7, 0.3), 0.5, 0.4, 0.8
    up = [0.7 * (internal**2 * back) ** (m + 1) * front.reflectance_below**m * 0.7 for m in range(60)]
    down = [0.7 * internal * passed * (internal**2 * back * front.reflectance_below) ** m for m in range(60)]
    assert plate.plate_reflectance(front, back, internal) == pytest.approx(0.2 + sum(up))
    assert plate.plate_transmittance(front, back, passed, internal) == pytest.approx(sum(down))


def test_an_opaque_plate_hides_its_back():
    front = plate.Face(0.2, 0.7, 0.3)
    assert plate.plate_reflectance(front, 0.5, 0.0) == 0.2
    assert plate.plate_transmittance(front, 0.5, 0.4, 0.0) == 0


def test_beers_law():
    """α = 4πk/λ: 1 mm of k = 1e-6 at 500 nm has α = 25.13 /m·10³ and passes e^−0.02513."""
    assert plate.internal_transmittance(1e-6, 1.0, 500.0) == pytest.approx(np.exp(-0.0251327412))
    assert plate.internal_transmittance(0.0, 1.0, 500.0) == 1
