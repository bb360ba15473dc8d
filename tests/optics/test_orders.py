"""The layer as a series in its round-trip phase: against the closed form and against brute averaging."""

import jax
import numpy as np
import pytest

from pellicle.dispersion.empirical import Cauchy
from pellicle.optics import film, interface, orders, response
from pellicle.optics.pair import Pair, abs2, imag, real

WAVELENGTH = np.linspace(420.0, 900.0, 25)
# a Gaussian blur by the trapezoidal rule: as good as exact for what is smooth on a scale of σ/20
NODES = np.linspace(-8.0, 8.0, 321)
WEIGHTS = np.exp(-0.5 * NODES**2) / np.sum(np.exp(-0.5 * NODES**2))

FILMS = {
    "oxide on silicon": (1.0, 1.46, 3.9 + 0.02j, 0.6),
    "absorbing on metal": (1.0, 2.1 + 0.05j, 0.2 + 3.4j, 0.9),
    "from glass": (1.52, 2.3, 1.0 + 0j, 0.3),
    "evanescent substrate": (1.52, 2.3, 1.0 + 0j, 0.9),
}
CASES = pytest.mark.parametrize("name", FILMS)
LETTERS = pytest.mark.parametrize("letter", "sp")


def media(name):
    ambient, layer, substrate, angle = FILMS[name]
    at = np.ones_like(WAVELENGTH)
    layer = Pair(layer.real * at, layer.imag * at) if isinstance(layer, complex) else layer * at
    return ambient, layer, Pair(substrate.real * at, substrate.imag * at), angle


def closed(name, thickness, letter, wavelength=WAVELENGTH):
    ambient, layer, substrate, angle = media(name)
    (wave,) = film.film(ambient, layer, substrate, 2 * np.pi / wavelength * thickness, angle, letter)
    return response.reflectance(wave), response.transmittance(wave), response.reflectance_below(wave)


def series(name, thickness, letter, window, count):
    ambient, layer, substrate, angle = media(name)
    k0d = 2 * np.pi / WAVELENGTH * thickness
    b = orders.airy_series(ambient, layer, substrate, k0d, angle, letter)
    back = orders.reversed_series(b)
    return (
        orders.reflectance(b, window, count),
        orders.transmittance(b, window, count),
        orders.reflectance(back, window, count),
    )


def everything(m):
    return 1.0


@CASES
@LETTERS
def test_all_orders_sum_to_airys_formula(name, letter):
    for one, two in zip(
        series(name, 500.0, letter, everything, 64), closed(name, 500.0, letter), strict=True
    ):
        np.testing.assert_allclose(one, two, atol=1e-13)


def ratio_and_first(name, thickness, letter):
    """|q| and |K| of the docstring, from its own formulas."""
    ambient, layer, substrate, angle = media(name)
    b = orders.airy_series(ambient, layer, substrate, 2 * np.pi / WAVELENGTH * thickness, angle, letter)
    upper, lower = (np.asarray(real(x)) + 1j * np.asarray(imag(x)) for x in (b.upper, b.lower))
    beta = lower * np.asarray(b.damping)
    echo = np.abs(1 - upper**2) ** 2 * np.abs(beta) ** 2 / (1 - np.abs(upper * beta) ** 2)
    return np.abs(upper * beta), np.abs(beta * ((1 - upper**2) * np.conj(upper) - upper * echo))


@CASES
@LETTERS
@pytest.mark.parametrize("count", [1, 2, 4])
def test_what_is_left_out_is_below_the_stated_bound(name, letter, count):
    ratio, first = ratio_and_first(name, 500.0, letter)
    left = np.abs(series(name, 500.0, letter, everything, count)[0] - closed(name, 500.0, letter)[0])
    assert np.all(left <= 2 * first * ratio**count / (1 - ratio) + 1e-14)
    if name != "evanescent substrate":  # where R is 1 by every order
        assert np.max(left) > 1e-6


@CASES
@LETTERS
def test_no_order_is_the_phase_average(name, letter):
    """An incoherent layer: seed 004's average over the phase, here over 720 of its values."""
    none = series(name, 500.0, letter, everything, 0)
    ambient, layer, substrate, angle = media(name)
    b = orders.airy_series(ambient, layer, substrate, 2 * np.pi / WAVELENGTH * 500.0, angle, letter)
    phase = np.linspace(0, 2 * np.pi, 720, endpoint=False)[:, None]
    beta = b.lower * b.damping * Pair(np.cos(phase), np.sin(phase))
    airy = abs2((b.upper + beta) / (1 + b.upper * beta))
    np.testing.assert_allclose(none[0], np.mean(airy, axis=0), atol=1e-12)


@LETTERS
@pytest.mark.parametrize("name", ["oxide on silicon", "from glass"])
@pytest.mark.parametrize("spread", [1.0, 20.0, 80.0])
def test_uneven_thickness_is_the_average_over_thickness(name, letter, spread):
    ambient, layer, _, angle = media(name)
    q1 = interface.normal(layer, ambient * np.sin(angle))
    variance = orders.phase_variance(0.0, 0.0, real(q1), spread, WAVELENGTH)
    damped = series(name, 500.0, letter, orders.gaussian(variance), 40)
    brute = closed(name, 500.0 + spread * NODES[:, None], letter)
    for signal, each in zip(damped, brute, strict=True):
        np.testing.assert_allclose(signal, WEIGHTS @ each, atol=1e-12)


def dispersive(wavelength):
    """2 µm of a dispersive layer (TiO2-like: n from 2.55 to 2.2) on glass, closed form."""
    layer = Cauchy(2.1, 8e4).index(wavelength)
    (wave,) = film.film(1.0, layer, 1.52 + 0 * wavelength, 2 * np.pi / wavelength * 2000.0)
    return response.reflectance(wave)


def test_bandwidth_is_the_average_over_wavelength():
    """With the group index in it; the phase over the wavelength alone would be wrong by 0.01."""
    fwhm = 5.0
    sigma = fwhm / (2 * np.sqrt(2 * np.log(2)))
    brute = WEIGHTS @ dispersive(WAVELENGTH + sigma * NODES[:, None])

    def phase(wavelength):
        return 4 * np.pi / wavelength * 2000.0 * Cauchy(2.1, 8e4).index(wavelength)

    layer = Cauchy(2.1, 8e4).index(WAVELENGTH)
    b = orders.airy_series(1.0, layer, 1.52 + 0 * WAVELENGTH, 2 * np.pi / WAVELENGTH * 2000.0, None, "s")
    _, slope = jax.jvp(phase, (WAVELENGTH,), (np.ones_like(WAVELENGTH),))

    def damped(slope):
        return orders.reflectance(
            b, orders.gaussian(orders.phase_variance(slope, fwhm, layer, 0.0, WAVELENGTH)), 12
        )

    # the series holds r₁₂ and the slope constant over the band: what is left is their variation there
    assert np.max(np.abs(damped(slope) - brute)) < 1e-3
    assert np.max(np.abs(damped(phase(WAVELENGTH) / WAVELENGTH) - brute)) > 0.005
    assert np.max(np.abs(dispersive(WAVELENGTH) - brute)) > 0.02


def test_two_blurs_add_their_variances():
    both = orders.phase_variance(0.3, 4.0, 1.4, 10.0, 500.0)
    assert both == pytest.approx(
        orders.phase_variance(0.3, 4.0, 1.4, 0.0, 500.0) + orders.phase_variance(0.3, 0.0, 1.4, 10.0, 500.0)
    )
