"""Numbers that textbooks and papers give."""

import numpy as np
import pytest

import pellicle as pl


def test_quarter_wave_of_magnesium_fluoride():
    """((n₀n₂ − n₁²)/(n₀n₂ + n₁²))²: Born and Wolf, Principles of Optics, section 1.6.4; 1.26 % on glass."""
    n, glass, wavelength = 1.38, 1.52, 550.0
    found = pl.reflectance(wavelength, wavelength / (4 * n), n, glass)
    assert found == pytest.approx(((glass - n**2) / (glass + n**2)) ** 2, rel=1e-13)
    assert found == pytest.approx(0.0126, abs=5e-5)


def test_ideal_antireflection():
    """n₁ = √(n₀n₂) at a quarter wave reflects nothing (same section)."""
    n = np.sqrt(1.52)
    assert pl.reflectance(550.0, 550.0 / (4 * n), n, 1.52) == pytest.approx(0, abs=1e-30)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_a_half_wave_layer_is_absent(order):
    """An optical thickness of mλ/2 leaves the bare substrate (same section)."""
    found = pl.reflectance(550.0, order * 550.0 / (2 * 2.35), 2.35, 1.52)
    assert found == pytest.approx((0.52 / 2.52) ** 2, rel=1e-12)


def test_a_half_wave_at_an_angle():
    """There it is n cos θ₁ that counts."""
    cosine = np.sqrt(1 - (np.sin(np.deg2rad(60)) / 2.35) ** 2)
    for letter in "sp":
        bare, layered = (
            pl.reflectance(550.0, d, 2.35, 1.52, angle=60.0, polarisation=letter)
            for d in (0.0, 550.0 / (2 * 2.35 * cosine))
        )
        assert float(layered) == pytest.approx(float(bare), rel=1e-12)


def test_bare_glass_and_its_brewster_angle():
    """4 % at normal incidence; none of p at tan θ = n (D. Brewster, 1815)."""
    assert pl.reflectance(550.0, 0.0, 1.46, 1.5) == pytest.approx(0.04)
    brewster = np.rad2deg(np.arctan(1.5))
    assert pl.reflectance(550.0, 0.0, 1.46, 1.5, angle=brewster, polarisation="p") < 1e-30


def test_frustrated_total_reflection():
    """45° prisms a gap apart, s: T = 1/(1 + sinh²(κd)·((n²−1)²/(4n²cos²θ(n²sin²θ−1)))).

    S. Zhu et al., Am. J. Phys. 54, 601 (1986), eq. 1.
    """
    n, theta, gap, wavelength = 1.517, np.deg2rad(45), 300.0, 632.8
    root = (n * np.sin(theta)) ** 2 - 1
    alpha = (n**2 - 1) ** 2 / (4 * n**2 * np.cos(theta) ** 2 * root)
    truth = 1 / (1 + alpha * np.sinh(2 * np.pi * gap / wavelength * np.sqrt(root)) ** 2)
    found = pl.transmittance(wavelength, gap, 1.0, n, ambient=n, angle=45.0, polarisation="s")
    assert found == pytest.approx(truth, rel=1e-12)
