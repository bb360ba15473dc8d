"""Mixtures: their own equations, limits, bounds, gradients at the ends, and fits of a porosity."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pellicle as pl
from pellicle.dispersion.effective_medium import MIXTURES, Bruggeman, Linear, Looyenga, MaxwellGarnett
from pellicle.dispersion.empirical import Cauchy, Constant
from pellicle.materials import material, materials_in
from pellicle.optics.pair import imag, is_real, real
from pellicle.recipes import media
from pellicle.simulation.spectra import simulate_signal

EVERY_RULE = pytest.mark.parametrize("rule", MIXTURES.values(), ids=MIXTURES)
AT = np.array([500.0])
part = st.tuples(
    st.floats(0.05, 5.0), st.one_of(st.just(0.0), st.floats(0.0, 8.0), st.just(1e-12))
)  # n and k


def epsilon(rule, host, inclusion, fraction):
    return complex(rule(Constant(*host), Constant(*inclusion), fraction)(500.0)) ** 2


@given(part, part, st.floats(0.0, 1.0))
def test_bruggeman_solves_its_equation_and_absorbs(host, inclusion, f):
    e, h, i = epsilon(Bruggeman, host, inclusion, f), complex(*host) ** 2, complex(*inclusion) ** 2
    left = f * (i - e) * (h + 2 * e) + (1 - f) * (h - e) * (i + 2 * e)
    assert abs(left) < 1e-11 * (abs(h) + abs(i)) ** 2
    index = complex(Bruggeman(Constant(*host), Constant(*inclusion), f)(500.0))
    assert index.imag >= 0
    assert index.real >= 0


@given(part, part)
def test_bruggeman_follows_one_root_from_host_to_inclusion(host, inclusion):
    """The root that is the host at 0: no jump on the way."""
    f = np.linspace(0.0, 1.0, 801)
    found = np.array(_path(np.float64(host), np.float64(inclusion), f))
    e, h, i = (found[0] + 1j * found[1]) ** 2, complex(*host) ** 2, complex(*inclusion) ** 2
    assert e[0] == pytest.approx(h, rel=1e-9)
    assert e[-1] == pytest.approx(i, rel=1e-9)
    other = -0.5 * h * i / e  # the product of the roots is −ε_h ε_i/2
    step, apart = np.abs(np.diff(e)), np.abs(e - other)
    assert np.all(step < np.maximum(apart[1:], apart[:-1]) + 0.02 * (abs(h) + abs(i)))


@jax.jit
def _path(host, inclusion, f):
    value = Bruggeman(Constant(host[0], host[1]), Constant(inclusion[0], inclusion[1]), f).index(f * 0 + 500)
    return real(value), imag(value)


def test_each_rule_by_its_definition():
    host, inclusion, f = (1.46, 0.0), (0.2, 3.4), 0.2
    h, i = complex(*host) ** 2, complex(*inclusion) ** 2
    e = epsilon(MaxwellGarnett, host, inclusion, f)
    assert (e - h) / (e + 2 * h) == pytest.approx(f * (i - h) / (i + 2 * h), rel=1e-12)
    e = epsilon(Looyenga, host, inclusion, f)
    assert e ** (1 / 3) == pytest.approx(f * i ** (1 / 3) + (1 - f) * h ** (1 / 3), rel=1e-12)
    assert epsilon(Linear, host, inclusion, f) == pytest.approx(f * i + (1 - f) * h, rel=1e-12)


@EVERY_RULE
@given(st.floats(0.3, 5.0), st.floats(0.3, 5.0), st.floats(0.0, 1.0))
def test_wiener_bounds(rule, host, inclusion, f):
    """Between the harmonic and the arithmetic mean of transparent permittivities."""
    h, i = host**2, inclusion**2
    e = float(rule(Constant(host), Constant(inclusion), f).index(500.0)) ** 2
    assert 1 / (f / i + (1 - f) / h) <= e * (1 + 1e-12)
    assert e <= (f * i + (1 - f) * h) * (1 + 1e-12)


@EVERY_RULE
def test_two_transparent_media_stay_real(rule):
    glass, air = Cauchy(1.45, 3000.0), Constant(1.0)
    assert is_real(rule(glass, air, 0.3).index(AT))
    assert is_real(rule(rule(glass, air, 0.3), air, 0.1).index(AT))
    assert not is_real(rule(glass, Constant(1.0, 0.0), 0.3).index(AT))


@pytest.mark.slow
@EVERY_RULE
@pytest.mark.parametrize("f", [0.0, 1e-9, 0.3, 1 / 3, 2 / 3, 1.0])
@pytest.mark.parametrize("inclusion", [(1.0, 0.0), (0.2, 3.4), (1.46, 0.0)], ids=["air", "metal", "same"])
def test_gradients(rule, f, inclusion):
    """In the fraction and every index, at the ends of the fraction and at k = 0 too."""

    def value(x):
        index = rule(Constant(x[0], x[1]), Constant(x[2], x[3]), x[4]).index(500.0)
        return jnp.stack([real(index), imag(index)])

    at = np.array([1.46, 0.0, *inclusion, f])
    slope = np.asarray(jax.jit(jax.jacrev(value))(at))
    least, most = [-np.inf, 0.0, -np.inf, 0.0, 0.0], [np.inf, np.inf, np.inf, np.inf, 1.0]
    for i, step in enumerate(1e-6 * np.eye(5)):
        up, down = (np.clip(at + way * step, least, most) for way in (1, -1))
        numeric = (np.asarray(value(up)) - np.asarray(value(down))) / (up[i] - down[i])
        np.testing.assert_allclose(slope[:, i], numeric, rtol=2e-5, atol=2e-5)


@EVERY_RULE
def test_precision_follows_the_wavelength(rule):
    model = rule(Cauchy(1.45, 3000.0), Constant(0.2, 3.4), 0.3)
    single = jax.jit(model)(AT.astype(np.float32))
    assert single.dtype == np.complex64
    np.testing.assert_allclose(single, model(AT), rtol=1e-6)


def test_materials_keep_their_names_and_ranges(refuses):
    porous = Bruggeman(material("SiO2"), material("TiO2"), 0.3)
    assert {m.name for m in materials_in(porous)} == {"SiO2", "TiO2"}
    scene = pl.Scene(pl.Layer(porous, 100.0), "Si")
    refuses(
        ValueError,
        r"all media are known from 250 to 1450 nm \(Si .*SiO2 210",
        simulate_signal,
        scene,
        np.array([100.0, 5000.0]),
    )


@EVERY_RULE
@pytest.mark.parametrize("fraction", [-0.1, 1.1, pl.Free(-0.5, 0.5), pl.Free(0, 2)])
def test_fractions_outside_0_to_1(rule, fraction, refuses):
    refuses(ValueError, "fraction must lie in 0 to 1, got", rule, Constant(1.46), Constant(1.0), fraction)


@pytest.mark.slow
def test_a_fit_finds_a_tauc_lorentz_layer():
    """All six numbers at once, from the default bounds."""
    truth = {"eps_inf": 1.5, "A": 120.0, "E0": 4.1, "C": 2.3, "Eg": 2.2, "thickness": 120.0}
    film = pl.Layer(media.medium("tauc-lorentz(120,4.1,2.3,2.2,1.5)"), 120.0)
    data = pl.simulate(pl.Scene(film, "Si"), np.linspace(300, 900, 121), noise=0.001, seed=1)
    free = pl.Layer(media.medium("tauc-lorentz"), pl.Free(50, 300))
    fit = pl.fit(data, pl.Scene(free, "Si"))
    assert fit.status.value == "converged"
    for name, value in truth.items():
        found = fit.parameters[name]
        assert found.value == pytest.approx(value, abs=4 * found.stderr_noise)
        assert found.stderr_noise < 0.05 * value
    assert fit.parameters["Eg"].unit == "eV"
