"""Terms of other programs: 50 digits, peers, Kramers-Kronig by quadrature, gradients, hard values."""

import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad

import pellicle.dispersion as d
from pellicle.dispersion.base import HC, known_index
from pellicle.optics.complex_functions import digamma, faddeeva
from pellicle.optics.pair import Pair, imag, real
from pellicle.optics.special import dawson_integral
from pellicle.recipes.dispersion_models import KINDS, TERMS

from .test_oscillators import kramers_kronig

MODELS = {
    "drude-smith": d.DrudeSmith(2.1, 0.3, -0.6),
    "uv-pole": d.UVPole(80.0, 9.5),
    "ir-pole": d.IRPole(0.3),
    "critical-point": d.CriticalPoint(1.3, 2.7, 0.25, -40.0, 0.5),
    "cppb": d.ParabolicBand(3.0, 2.7, 0.4, 25.0, -0.5),
    "adachi-m0": d.AdachiM0(6.0, 1.42, 0.03),
    "adachi-m1": d.AdachiM1(6.4, 2.9, 0.1),
    "tanguy": d.Tanguy(7.3, 3.4, 0.06, 0.05),
    "brendel-bormann": d.BrendelBormann(25.0, 4.1, 0.08, 0.83),
    "psemi": d.Psemi(5.0, 3.4, 0.2, 1.5, 0.8, 0.4, 0.6, 0.3, 0.2, 0.5, -0.4),
    "new-amorphous": d.NewAmorphous(1.6, 1.9, (0.1, 0.05), (4.2, 6.5), (1.1, 0.8)),
    "forouhi-bloomer": d.ForouhiBloomer(1.6, 1.9, (0.1, 0.05), (8.4, 13.0), (18.85, 42.89)),
    "harmonic-oscillators": d.HarmonicOscillators(
        *((120.0, 2.0), (10.5, 3.3), (2.0, 0.9), (0.3333, 0.2), (-10.0, 40.0))
    ),
    # sapphire-like: two phonons
    "gervais": d.Gervais(3.08, (0.0545, 0.0706), (0.0004, 0.0007), (0.0596, 0.1112), (0.00045, 0.0012)),
}
ENERGY = np.array([0.6, 1.4, 2.2, 2.7, 3.3, 4.6])


def adachi_m0(t, E):
    x = (E + 1j * mp.mpf(t.gamma)) / t.E0
    return t.A * mp.mpf(t.E0) ** -1.5 * (2 - mp.sqrt(1 + x) - mp.sqrt(1 - x)) / x**2


def adachi_m1(t, E):
    x = (E + 1j * mp.mpf(t.gamma)) / t.E0
    return -t.A * mp.log(1 - x**2) / x**2


def tanguy(t, E):
    z = E + 1j * mp.mpf(t.gamma)

    def g(z):
        xi = mp.sqrt(t.R / (t.Eg - z))
        return 2 * mp.log(xi) - 2 * mp.pi * mp.cot(mp.pi * xi) - 2 * mp.digamma(xi) - 1 / xi

    return t.A * mp.sqrt(t.R) / z**2 * (g(z) + g(-z) - 2 * g(mp.mpf(0)))


def brendel_bormann(t, E):
    a, width = mp.sqrt(E**2 + 1j * E * mp.mpf(t.gamma)), mp.sqrt(2) * t.sigma
    w = lambda z: mp.exp(-z * z) * mp.erfc(-1j * z)  # noqa: E731
    both = w((a - t.E0) / width) + w((a + t.E0) / width)
    return 1j * mp.sqrt(mp.pi) * t.A / (2 * a * width) * both


def critical_point(t, E):
    turn = mp.expj(mp.radians(t.phase))
    near, far = (t.E0 / (t.E0 - sign * (E + 1j * mp.mpf(t.gamma))) for sign in (1, -1))
    return t.A * (turn * near**t.mu + mp.conj(turn) * far**t.mu)


def parabolic_band(t, E):
    return t.A * mp.expj(mp.radians(t.phase)) * (t.gamma / (2 * t.E0 - 2 * E - 1j * mp.mpf(t.gamma))) ** t.mu


def drude_smith(t, E):
    tau = 1 / mp.mpf(t.gamma)
    return -(t.Ep**2) / (E**2 + 1j * E * t.gamma) * (1 + t.c / (1 - 1j * E * tau))


PRINTED = {
    **{"adachi-m0": adachi_m0, "adachi-m1": adachi_m1, "tanguy": tanguy, "brendel-bormann": brendel_bormann},
    **{"critical-point": critical_point, "cppb": parabolic_band, "drude-smith": drude_smith},
    "uv-pole": lambda t, E: mp.mpf(t.A) / (mp.mpf(t.E0) ** 2 - E**2),
    "ir-pole": lambda t, E: -mp.mpf(t.A) / E**2,
}


def complex_of(term, energy):
    value = term.epsilon(np.asarray(energy))
    return np.asarray(value.re) + 1j * np.asarray(value.im)


@pytest.mark.parametrize("name", PRINTED)
def test_printed_formula_at_50_digits(name):
    with mp.workdps(50):
        exact = [complex(PRINTED[name](MODELS[name], mp.mpf(E))) for E in ENERGY]
    np.testing.assert_allclose(complex_of(MODELS[name], ENERGY), exact, rtol=2e-13)


def test_every_term_and_the_marked_models_are_here():
    new = {name for name, kind in KINDS.items() if kind.__module__.rpartition(".")[2] not in OLD}
    assert new <= MODELS.keys()


OLD = ("empirical", "spline", "oscillators")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in MODELS if name in TERMS and MODELS[name].kramers_kronig])
def test_kramers_and_kronig(name):
    """ε₁ of every term that is marked is the integral of its ε₂."""
    term = MODELS[name]
    if name in ("uv-pole", "ir-pole"):  # a line at the pole and free charges without damping
        assert np.all(complex_of(term, ENERGY).imag == 0)
        return
    loss = lambda E: float(imag(term.epsilon(np.float64(E))))  # noqa: E731
    corners = [getattr(term, "E0", getattr(term, "Eg", 1.0))]
    if name == "drude-smith":  # ε₂ has a pole at 0, whose transform is 0
        static = term.Ep**2 / term.gamma * (1 + term.c)
        loss = lambda E: float(imag(term.epsilon(np.float64(E)))) - static / E  # noqa: E731
    at, end = ENERGY[[1, 3]], np.inf
    if name == "psemi":  # ε₂ is 0 beyond 5 eV
        corners, end = [1.9, 2.8, *corners, 3.88, 4.2, 6.0], 6.0
    np.testing.assert_allclose(
        complex_of(term, at).real, [kramers_kronig(loss, E, corners, end) for E in at], rtol=2e-6, atol=2e-6
    )


def test_phonons_obey_kramers_and_kronig():
    model = MODELS["gervais"]

    def epsilon(E):
        index = model.index(np.float64(HC / E))
        return complex(index.re, index.im) ** 2

    for E in (0.03, 0.2):
        own = E * epsilon(E).imag
        share = lambda x: (x * epsilon(x).imag - own) / (x * x - E * E)  # noqa: B023, E731
        total = quad(share, 1e-6, 0.4, points=[*model.TO, *model.LO, E], limit=500)[0]
        total += quad(share, 0.4, np.inf)[0]
        assert epsilon(E).real == pytest.approx(model.eps_inf + 2 / np.pi * total, rel=1e-5)


def test_a_band_without_its_mirror_is_not_marked():
    """At E = 0 the permittivity of a causal medium is real."""
    assert not d.ParabolicBand.kramers_kronig
    assert abs(complex_of(MODELS["cppb"], 1e-9).imag) > 1
    assert abs(complex_of(MODELS["critical-point"], 1e-9).imag) < 1e-7


def test_psemi_is_a_broadened_spline():
    """ε₂ before broadening, written out, convolved numerically; ends and height without broadening."""
    t, s = MODELS["psemi"], MODELS["psemi"].fwhm / (2 * np.sqrt(np.log(2)))

    def sharp(E):
        left = E < t.E0
        width, place, height, bend = (getattr(t, x + ("L" if left else "R")) for x in "WPAO")
        u, joint = abs(E - t.E0), place * width
        if u > joint:
            v = (width - u) / (width - joint)
            return t.A * height * ((1 - bend) * v + bend * v * v)
        slope = -height * (1 + bend) / (width - joint)  # that of the outer piece
        square = (slope * joint - height + 1) / joint**2
        return t.A * (1 + (slope - 2 * square * joint) * u + square * u * u)

    nodes = [t.E0 - t.WL, t.E0 - t.PL * t.WL, t.E0, t.E0 + t.PR * t.WR, t.E0 + t.WR]
    for E in (1.9, 3.4, 4.0):
        bell = lambda x: np.exp(-(((E - x) / s) ** 2)) - np.exp(-(((E + x) / s) ** 2))  # noqa: B023, E731
        parts = [quad(lambda x: sharp(x) * bell(x), a, b)[0] for a, b in itertools.pairwise(nodes)]  # noqa: B023
        assert complex_of(t, E).imag == pytest.approx(sum(parts) / (np.sqrt(np.pi) * s), rel=1e-9)
    narrow = complex_of(d.Psemi(5.0, 3.4, 1e-4, 1.5, 0.8, AL=0.3), np.array([3.4, 2.65, 4.3])).imag
    np.testing.assert_allclose(narrow, [5.0, 1.5, 0.0], atol=1e-3)


# pyElli 0.23.1 (`Tanguy(A=7.27, d=3, gamma=0.05, R=0.06, Eg=3.4)`, `Poles(A_ir=0.1, A_uv=30, E_uv=8)`)
# and PyMoosh 4.0.1 (`models.BrendelBormann` of gold, its hc 4e-8 smaller), at 400 and 800 nm
GOLD = ((0.054, 0.218, 0.074, 0.742), (0.05, 2.885, 0.035, 0.349), (0.312, 4.069, 0.083, 0.83))


def test_values_of_pyelli_and_pymoosh():
    energy = HC / np.array([400.0, 800.0])
    exciton = 1 + complex_of(d.Tanguy(7.27, 3.4, 0.06, 0.05), energy)
    np.testing.assert_allclose(exciton, [2.0730675 + 0.0767145j, 1.56502289 + 0.004075j], rtol=1e-7)
    poles = complex_of(d.UVPole(30.0, 8.0), energy) - complex_of(d.IRPole(0.1), energy)
    np.testing.assert_allclose(poles, [0.56195562, 0.52866183], rtol=1e-7)
    gold = 1 + complex_of(d.Drude(9.03 * 0.77**0.5, 0.05), energy)
    gold = gold + sum(complex_of(d.BrendelBormann(f * 9.03**2, *x), energy) for f, *x in GOLD)
    np.testing.assert_allclose(gold, [-4.06599583 + 5.08571248j, -24.29281288 + 1.73416627j], rtol=2e-7)


def test_forouhi_and_bloomer_in_both_sets_of_parameters():
    """n and k of the paper's formula, and the same curve in Jobin-Yvon's parameters."""
    m, E = MODELS["forouhi-bloomer"], ENERGY
    n, k = m.n_inf + 0 * E, 0 * E
    for a, b, c in zip(m.A, m.B, m.C, strict=True):
        q = 0.5 * np.sqrt(4 * c - b * b)
        b0 = a / q * (-b * b / 2 + m.Eg * b - m.Eg**2 + c)
        c0 = a / q * ((m.Eg**2 + c) * b / 2 - 2 * m.Eg * c)
        n, k = n + (b0 * E + c0) / (E * E - b * E + c), k + a * (E - m.Eg) ** 2 / (E * E - b * E + c)
    for name in ("forouhi-bloomer", "new-amorphous"):
        value = known_index(MODELS[name], HC / E)
        np.testing.assert_allclose(value.re, n, rtol=1e-12)
        np.testing.assert_allclose(value.im, np.where(m.Eg < E, k, 0), rtol=1e-12)


def test_the_local_field_is_that_of_lorentz_and_lorenz():
    """(ε − 1)/(ε + 2) of a gas of electrons, by ħ²e²/(ε₀m) of CODATA 2018 in SI units."""
    model = d.HarmonicOscillators((200.0,), (9.5,), (0.4,), (1 / 3,), (0.0,))
    value = known_index(model, HC / ENERGY)
    epsilon = (value.re + 1j * value.im) ** 2
    strength = 200e27 * (1.054571817e-34**2 / (8.8541878128e-12 * 9.1093837015e-31))
    polarised = strength / (9.5**2 - ENERGY**2 - 0.4j * ENERGY)
    np.testing.assert_allclose((epsilon - 1) / (epsilon + 2), polarised / 3, rtol=1e-9)


def test_one_phonon_with_equal_dampings_is_a_lorentz_oscillator():
    wavelength = np.array([5e3, 9e3, 12e3, 30e3])
    one = d.Gervais(2.4, (0.1,), (0.004,), (0.13,), (0.004,))
    same = d.Oscillators(2.4, (d.Lorentz(2.4 * (0.13**2 / 0.1**2 - 1), 0.1, 0.004),))
    a, b = known_index(one, wavelength), known_index(same, wavelength)
    np.testing.assert_allclose(a.re, b.re, rtol=1e-11)
    np.testing.assert_allclose(a.im, b.im, rtol=1e-11)


WAVELENGTH = HC / np.array([0.11, *ENERGY])


@jax.jit
@jax.value_and_grad
def mixed(model):
    """One number that depends on n and k, and its slopes: one program for all models of a kind."""
    index = model.index(jnp.asarray(WAVELENGTH))
    return jnp.sum(jnp.sin(real(index)) + jnp.cos(3 * imag(index)))


@pytest.mark.slow
def test_gradients_against_central_differences():
    """In every parameter of every model; differences by NumPy."""
    for model in (d.Oscillators(3.0, (m,)) if name in TERMS else m for name, m in MODELS.items()):
        slopes = jax.tree.leaves(mixed(model)[1])
        leaves, structure = jax.tree.flatten(model)

        def value(i, leaf, leaves=leaves, structure=structure):
            index = known_index(
                jax.tree.unflatten(structure, [*leaves[:i], leaf, *leaves[i + 1 :]]), WAVELENGTH
            )
            return float(np.sum(np.sin(real(index)) + np.cos(3 * imag(index))))

        for i, leaf in enumerate(leaves):
            step = 1e-5 * max(abs(leaf), 1e-2)
            numeric = (value(i, leaf + step) - value(i, leaf - step)) / (2 * step)
            assert float(slopes[i]) == pytest.approx(numeric, rel=2e-5, abs=2e-6), (model, i)


@pytest.mark.slow
def test_finite_at_hard_values():
    """On resonance, at edges, without strength or damping, far from everything."""
    hard = [
        d.Oscillators(1.0, (term,))
        for term in [
            d.AdachiM0(5.0, 2.2, 0.0),
            *(d.AdachiM1(5.0, 2.2, 1e-4), d.DrudeSmith(0.0, 0.1, -1.0)),
            *(d.Tanguy(0.0, 2.2, 0.3, 1e-3), d.Tanguy(5.0, 2.2, 0.0005, 1e-3)),
            *(d.BrendelBormann(5.0, 2.2, 0.0, 1e-3), d.BrendelBormann(0.0, 0.02, 0.1, 2.0)),
            *(d.Psemi(5.0, 2.2, 1e-3, 0.01, 4.0, 0.01, 0.99), d.CriticalPoint(5.0, 2.2, 1e-3, 180.0, 4.0)),
            d.ParabolicBand(5.0, 2.2, 1e-3, -90.0, -1.0),
        ]
    ]
    hard += [
        d.NewAmorphous(1.0, 2.2, (1.0,), (2.2,), (0.01,)),
        d.ForouhiBloomer(1.5, 0.0, (1.0,), (9.0,), (0.0,)),
    ]
    for model in hard:
        assert all(np.isfinite(x) for x in jax.tree.leaves(mixed(model))), model
        index = known_index(model, WAVELENGTH)
        assert np.all(imag(index) >= 0)
        assert np.all(real(index) >= 0) or not isinstance(model, d.Oscillators)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: d.DrudeSmith(1.0, 0.1, 0.5), "c must lie in -1 to 0, got 0.5"),
        (lambda: d.Tanguy(1.0, 3.0, 0.0, 0.1), "R must be positive"),
        (lambda: d.Psemi(1.0, 3.0, 0.1, 1.0, 1.0, PL=1.0), "PL must be below 1"),
        (lambda: d.Gervais(1.0, (0.1,), (0.01,), (0.1, 0.2), (0.01,)), "one number for each phonon"),
        (lambda: d.NewAmorphous(1.0, 2.0, (), (), ()), "one number for each resonance"),
        (lambda: d.HarmonicOscillators((), (), (), (), ()), "one number for each, at least one"),
    ],
)
def test_impossible_parameters(make, said, refuses):
    refuses(ValueError, said, make)


def test_special_functions_at_50_digits():
    z = np.array([0.3 + 0j, 5.5 + 1e-9j, -3.1 + 0.2j, 80 - 0j, 1e-3 + 7j, 2.2 + 3j])
    with mp.workdps(50):
        w = [complex(mp.exp(-(mp.mpc(x) ** 2)) * mp.erfc(-1j * mp.mpc(x))) for x in z]
        psi = [complex(mp.digamma(mp.mpc(abs(x.real) + 0.01, x.imag))) for x in z]
        size = mp.sqrt(mp.pi) / 2
        area = [
            float(mp.quad(lambda t: size * mp.exp(-t * t) * mp.erfi(t), mp.linspace(0, x, 9)))
            for x in (0.1, 3.0, 5.999, 6.001, 12.0)
        ]
    found = faddeeva(Pair(z.real, z.imag))
    np.testing.assert_allclose(found.re + 1j * found.im, w, rtol=1e-13)
    found = digamma(Pair(np.abs(z.real) + 0.01, z.imag))
    np.testing.assert_allclose(found.re + 1j * found.im, psi, rtol=1e-13)
    np.testing.assert_allclose(dawson_integral(np.array([0.1, 3.0, 5.999, 6.001, -12.0])), area, rtol=1e-13)
