"""Oscillators: published numbers, Kramers-Kronig by quadrature, gradients at the hard points."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import special as scipy_special
from scipy.integrate import quad

from pellicle.dispersion.base import HC
from pellicle.dispersion.empirical import CauchyUrbach
from pellicle.dispersion.oscillators import CodyLorentz, Drude, Gaussian, Lorentz, Oscillators, TaucLorentz
from pellicle.optics.pair import imag, real
from pellicle.optics.special import arctan_over_root, dawson, scaled_ei

from ..differences import derivative

ENERGY = np.array([0.8, 1.5, 2.2, 3.3, 4.5])
# amorphous silicon, G. E. Jellison and F. A. Modine (1996), table I
SILICON = TaucLorentz(122.0, 3.45, 2.54, 1.20)
TERMS = {
    "lorentz": Lorentz(2.0, 3.0, 0.5),
    "drude": Drude(4.0, 0.3),
    "gaussian": Gaussian(2.0, 3.0, 0.5),
    "gaussian, wider than its energy": Gaussian(2.0, 0.8, 3.0),
    "tauc-lorentz": SILICON,
    "tauc-lorentz, narrow": TaucLorentz(60.0, 3.1, 0.3, 2.9),
    "tauc-lorentz, critically damped": TaucLorentz(60.0, 3.0, 6.0, 1.2),
    "tauc-lorentz, overdamped": TaucLorentz(60.0, 3.0, 6.5, 1.2),
    "tauc-lorentz, no gap": TaucLorentz(60.0, 3.0, 1.0, 0.0),
    "cody-lorentz": CodyLorentz(122.0, 3.45, 2.54, 1.2, 1.0),
    "cody-lorentz with a tail": CodyLorentz(122.0, 3.45, 2.54, 1.2, 1.0, 0.4, 0.08),
    "cody-lorentz, critically damped": CodyLorentz(60.0, 3.0, 6.0, 1.2, 2.0, 0.35, 0.2),
    "cody-lorentz, overdamped": CodyLorentz(60.0, 3.0, 6.5, 1.2, 0.3, 0.1, 0.05),
}
EVERY_TERM = pytest.mark.parametrize("term", TERMS.values(), ids=TERMS)


def epsilon_2(t):
    """ε₂ in plain numbers, and where it has corners or peaks."""
    lorentzian = lambda E: (E * E - t.E0**2) ** 2 + t.C**2 * E * E  # noqa: E731
    if isinstance(t, Lorentz):
        return lambda E: t.A * t.E0**2 * t.gamma * E / ((t.E0**2 - E * E) ** 2 + t.gamma**2 * E * E), [t.E0]
    if isinstance(t, Gaussian):
        s = t.fwhm / (2 * np.sqrt(np.log(2)))
        return lambda E: t.A * (np.exp(-(((E - t.E0) / s) ** 2)) - np.exp(-(((E + t.E0) / s) ** 2))), [t.E0]
    if isinstance(t, TaucLorentz):
        return lambda E: t.A * t.E0 * t.C * max(E - t.Eg, 0) ** 2 / lorentzian(E) / E, [t.Eg, t.E0]
    onset = t.Eg + t.Et
    product = lambda E: (  # noqa: E731
        (E - t.Eg) ** 2 / ((E - t.Eg) ** 2 + t.Ep**2) * t.A * t.E0 * t.C * E / lorentzian(E)
    )
    tail = onset * product(onset)
    return lambda E: product(E) if onset < E else tail / E * np.exp((E - onset) / t.Eu), [onset, t.E0]


def kramers_kronig(f, E, corners, end=np.inf):
    """(2/π) P∫ ξ f(ξ)/(ξ² − E²) dξ up to an end, with the pole in a window that holds no corner."""
    half = 0.5 * min([0.4, E, *(abs(E - c) for c in corners if abs(E - c) > 0)])
    share = lambda x: x * f(x) / (x + E)  # noqa: E731
    total = quad(share, E - half, E + half, weight="cauchy", wvar=E, epsabs=1e-10, limit=200)[0]
    nodes = sorted({1e-9, E - half, E + half, *corners, *(c - 0.2 for c in corners if c > 0.3)})
    for a, b in itertools.pairwise([*nodes, *(() if np.isfinite(end) else (20.0, np.inf))]):
        if not a < E < b and not (a >= E - half and b <= E + half):
            total += quad(lambda x: share(x) / (x - E), a, b, epsabs=1e-10, limit=200)[0]
    return 2 / np.pi * total


@EVERY_TERM
def test_kramers_and_kronig(term):
    found = term.epsilon(ENERGY)
    if isinstance(term, Drude):  # ε₂ diverges at 0: by the closed complex form instead
        exact = -(term.Ep**2) / (ENERGY * (ENERGY + 1j * term.gamma))
        np.testing.assert_allclose(np.asarray(found.re) + 1j * np.asarray(found.im), exact, rtol=1e-13)
        return
    f, corners = epsilon_2(term)
    np.testing.assert_allclose(found.im, [f(E) for E in ENERGY], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        found.re, [kramers_kronig(f, E, corners) for E in ENERGY], rtol=1e-8, atol=1e-8
    )


def test_tauc_lorentz_as_printed():
    """Jellison and Modine's eq. 6 with the erratum, term by term, in the form that divides by α."""
    t, E = SILICON, ENERGY
    alpha, gamma2 = np.sqrt(4 * t.E0**2 - t.C**2), t.E0**2 - t.C**2 / 2
    zeta4 = (E**2 - gamma2) ** 2 + alpha**2 * t.C**2 / 4
    a_ln = (t.Eg**2 - t.E0**2) * E**2 + t.Eg**2 * t.C**2 - t.E0**2 * (t.E0**2 + 3 * t.Eg**2)
    a_atan = (E**2 - t.E0**2) * (t.E0**2 + t.Eg**2) + t.Eg**2 * t.C**2
    sum_, product = t.E0**2 + t.Eg**2, alpha * t.Eg
    up, down = np.arctan((2 * t.Eg + alpha) / t.C), np.arctan((alpha - 2 * t.Eg) / t.C)
    printed = (
        t.A * t.C * a_ln / (2 * np.pi * zeta4 * alpha * t.E0) * np.log((sum_ + product) / (sum_ - product))
        - t.A * a_atan / (np.pi * zeta4 * t.E0) * (np.pi - up + down)
        + 4 * t.A * t.E0 * t.Eg * (E**2 - gamma2) / (np.pi * zeta4 * alpha) * (up + down)
        - t.A * t.E0 * t.C * (E**2 + t.Eg**2) / (np.pi * zeta4 * E) * np.log(np.abs(E - t.Eg) / (E + t.Eg))
        + 2 * t.A * t.E0 * t.C * t.Eg / (np.pi * zeta4)
        * np.log(np.abs(E - t.Eg) * (E + t.Eg) / np.sqrt((t.E0**2 - t.Eg**2) ** 2 + t.Eg**2 * t.C**2))
    )  # fmt: skip
    # the paper writes π − atan[(2Eg + α)/C] + atan[(−2Eg + α)/C], and atan[(α + 2Eg)/C] + atan[(α − 2Eg)/C]
    np.testing.assert_allclose(t.epsilon(E).re, printed, rtol=1e-12)


def sums(base, kind, *terms):
    return Oscillators(base, tuple(kind(*numbers) for numbers in terms))


TAUC_LORENTZ = sums(0.0, TaucLorentz, (100, 2.5, 0.1, 2), (150, 3, 0.05, 2), (300, 4.5, 0.02, 2))
GAUSSIAN = sums(0.0, Gaussian, (100, 3, 0.1), (150, 1.5, 0.05), (300, 0.3, 0.02))
LORENTZ = sums(1.0, Lorentz, (100 / 9, 3, 0.1), (150 / 2.25, 1.5, 0.05), (300 / 0.09, 0.3, 0.02))
URBACH = CauchyUrbach(1.5, 0.005 * HC**2, 0.0001 * HC**4, 0.0001, 0.4, 3.0)  # there in powers of E


@pytest.mark.parametrize(
    ("model", "wavelength", "value"),
    [
        (TAUC_LORENTZ, 400.0, -40.67006475806415 + 23.276498948468173j),
        (TAUC_LORENTZ, 602.0040080160321, 41.165694501532954 + 0.012442129451629407j),
        (GAUSSIAN, 400.0, -43.91081577811 + 6.388144540964682j),
        (GAUSSIAN, 418.0360721442886, 51.20927844853897 + 72.40416913349478j),
        (LORENTZ, 400.0, -181.49928350212207 + 67.26497574126284j),
        (LORENTZ, 602.0040080160321, -125.39109062943506 + 5.508474601780596j),
        (URBACH, 400.0, 2.425084410892506 + 0.0003995196444084635j),
        (URBACH, 602.0040080160321, 2.319551409465513 + 2.9015072602160455e-05j),
    ],
)
def test_published_numbers(model, wavelength, value):
    """pyElli's regression data (tests/test_dispersions, MIT): ε at wavelengths in nm. Its hc differs in the
    ninth digit; its own A of Lorentz is A E0² here; its sums of Gaussian and Tauc-Lorentz start at 0."""
    found = complex(model(wavelength)) ** 2
    assert found.real == pytest.approx(value.real, rel=1e-8)
    assert found.imag == pytest.approx(value.imag, rel=2e-8)


index_of = jax.jit(lambda term, wavelength: Oscillators(2.0, (term,))(wavelength))


HARD = {
    "lorentz": (3.0,),
    "gaussian": (3.0,),
    "tauc-lorentz": (1.2, 3.45, 1.2 + 1e-12, 1.2 - 1e-9),
    "tauc-lorentz, critically damped": (1.2, 3.0),
    "tauc-lorentz, no gap": (3.0, 1e-3),
    "cody-lorentz": (1.2, 3.45),
    "cody-lorentz with a tail": (1.2, 3.45),
}
"""Energies at the gap and on resonance."""


def _mixed(term, energy):
    index = Oscillators(1.7, (term,)).index(HC / energy)
    return jnp.sum(jnp.sin(real(index)) + jnp.cos(3 * imag(index)))


mixed, mixed_slopes = jax.jit(_mixed), jax.jit(jax.grad(_mixed, argnums=(0, 1)))


@pytest.mark.parametrize("name", TERMS)
def test_gradients_against_central_differences(name):
    """In every parameter and in energy; at zero strength that of the strength."""
    term, at = TERMS[name], np.array([0.9, 2.3, 3.7, *HARD.get(name, ())])
    leaves, structure = jax.tree.flatten(term)
    none = jax.tree.unflatten(structure, [0.0, *leaves[1:]])
    little = jax.tree.unflatten(structure, [1e-6, *leaves[1:]])
    numeric = (mixed(little, at) - mixed(none, at)) / 1e-6
    assert float(jax.tree.leaves(mixed_slopes(none, at)[0])[0]) == pytest.approx(
        float(numeric), rel=1e-4, abs=1e-4
    )
    slopes, along = mixed_slopes(term, at)
    for i, (leaf, slope) in enumerate(zip(leaves, jax.tree.leaves(slopes), strict=True)):
        if leaf == 0:  # a bound: one side only, and the tail has a corner there
            continue

        def moved(leaf, i=i):
            return mixed(jax.tree.unflatten(structure, [*leaves[:i], leaf, *leaves[i + 1 :]]), at)

        # rounding is divided by the step: of 0.05 a millionth would leave 1e-8
        numeric = derivative(moved, leaf, 1e-5 * leaf)
        assert float(slope) == pytest.approx(float(numeric), rel=2e-6, abs=1e-8)
    numeric = derivative(lambda at: mixed(term, at), at, 1e-6)
    assert float(jnp.sum(along)) == pytest.approx(float(numeric), rel=2e-6, abs=1e-7)


@pytest.mark.parametrize("name", TERMS)
def test_index_absorbs_and_keeps_its_precision(name):
    wavelength = np.array(
        [*np.linspace(250.0, 2500.0, 301), *(HC / E for E in (1.6, *HARD.get(name, ())) if E > 0.1)]
    )
    index = np.asarray(index_of(TERMS[name], wavelength))
    assert np.all(np.isfinite(index))
    assert np.all(index.imag >= 0)
    assert np.all(index.real >= 0)
    single = index_of(TERMS[name], wavelength.astype(np.float32))
    assert single.dtype == np.complex64
    np.testing.assert_allclose(single, index, rtol=3e-4, atol=3e-4)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Lorentz(-1.0, 3.0, 0.5), "A must not be negative, got -1"),
        (lambda: Drude(-1.0, 0.1), "Ep must not be negative"),
        (lambda: Gaussian(1.0, 3.0, -0.5), "fwhm must not be negative"),
        (lambda: TaucLorentz(10.0, 2.0, 1.0, 2.5), "Eg must lie below the resonance E0, got Eg 2.5 and E0 2"),
        (lambda: CodyLorentz(10.0, 4.0, 1.0, 2.5, 0.0), "Ep must be positive"),
        (lambda: CauchyUrbach(1.5, k0=-0.1), "k0 must not be negative"),
        (lambda: CauchyUrbach(1.5, Eu=0.0), "Eu must be positive"),
    ],
)
def test_impossible_parameters(make, said, refuses):
    refuses(ValueError, said, make)


def test_dawson():
    x = np.concatenate([np.linspace(-12, 12, 4001), np.logspace(1, 8, 50), [0.0, 1e-300]])
    np.testing.assert_allclose(jax.jit(dawson)(x), scipy_special.dawsn(x), rtol=2e-14, atol=3e-16)
    slope = jax.jit(jax.vmap(jax.grad(dawson)))(x)
    np.testing.assert_allclose(slope, 1 - 2 * x * scipy_special.dawsn(x), atol=1e-13)
    single = jax.jit(dawson)(x[:4001].astype(np.float32))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, scipy_special.dawsn(x[:4001]), atol=2e-7)


def test_scaled_exponential_integral():
    x = np.concatenate([-np.logspace(-3, 2.5, 200), np.logspace(-3, 2.5, 200)])
    x = x[np.abs(x - 0.3725) > 0.02]  # its zero
    exact = np.exp(-x) * scipy_special.expi(x)
    np.testing.assert_allclose(jax.jit(scaled_ei)(x), exact, rtol=2e-13)
    slope = jax.jit(jax.vmap(jax.grad(scaled_ei)))(x)
    np.testing.assert_allclose(slope, 1 / x - exact, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("u", [-4.0, -1e-2, -1e-5, -1e-300, 0.0, 1e-300, 1e-5, 1e-2, 4.0])
def test_arctangent_through_zero(u):
    """Against the complex function, in value and slope."""
    exact = lambda u: (np.arctan(0.3 * np.sqrt(u + 0j) / 1.1) / np.sqrt(u + 0j)).real  # noqa: E731
    value = exact(u) if abs(u) > 1e-12 else 0.3 / 1.1
    assert float(arctan_over_root(u, 0.3, 1.1)) == pytest.approx(value, rel=1e-13)
    slope = float(jax.grad(arctan_over_root)(u, 0.3, 1.1))
    assert slope == pytest.approx(derivative(exact, u, max(1e-3, 1e-4 * abs(u))), rel=1e-5)


def test_arctangent_beyond_the_right_angle():
    assert float(arctan_over_root(4.0, 1.0, -1.0)) == pytest.approx(np.arctan2(2.0, -1.0) / 2)
