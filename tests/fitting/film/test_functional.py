"""`pl.fitting.solve` against `pl.fit`, and what a second fit of the same kind costs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError

from ...airy import airy

NM = np.linspace(400.0, 900.0, 120)
STARTS = [{"A": 1.5, "thickness": 480.0}, {"A": 1.45, "thickness": 530.0}]


def film(index, thickness, b=3000.0, substrate=3.9):
    return pl.Scene(pl.Layer(pl.dispersion.Cauchy(index, b), thickness), substrate)


FREE = film(pl.Free(1.4, 1.6), pl.Free(100, 900))


@pytest.fixture
def programs():
    """Programs that JAX traces, lowers, compiles or loads."""
    events = []

    def listen(event, duration_secs, **about):
        if event.startswith("/jax/core/compile/"):
            events.append((event, about.get("fun_name")))

    jax.monitoring.register_event_duration_secs_listener(listen)
    yield events
    jax.monitoring.unregister_event_duration_listener(listen)


@pytest.fixture(scope="module")
def spectra():
    return [pl.simulate(film(1.5, 500.0), NM, noise=0.002, seed=seed) for seed in range(3)]


def starts(problem):
    return np.array([[start[name] for name in problem.names] for start in STARTS])


def test_the_log_density_is_half_of_chi_squared_with_its_slope(spectra):
    """χ² by the Airy formula in NumPy, with a normal prior on A."""
    prior = pl.Free(1.4, 1.6, prior=pl.priors.Normal(1.48, 0.01))
    with jax.enable_x64(True):
        problem = pl.fitting.prepare(spectra[0], film(prior, pl.Free(100, 900)))
        at = starts(problem) + 1e-3
        run = jax.jit(jax.vmap(jax.value_and_grad(problem.log_density)))
        density, slope = run(at)
        step = np.array([1e-6, 1e-4])[:, None] * np.eye(2)
        up, down = (run(at[0] + sign * step)[0] for sign in (1, -1))

    def half_chi2(values):
        named = dict(zip(problem.names, values, strict=True))
        index = named["A"] + 3000.0 / NM**2
        residual = (airy(NM, named["thickness"], index, 3.9, 1.0) - spectra[0].values) / 0.002
        return 0.5 * np.sum(residual**2) + 0.5 * ((named["A"] - 1.48) / 0.01) ** 2

    assert density[1] - density[0] == pytest.approx(half_chi2(at[0]) - half_chi2(at[1]), rel=1e-6)
    np.testing.assert_allclose(slope[0], (up - down) / (2 * step.sum(axis=0)), rtol=1e-4)


@pytest.mark.slow
def test_vmapped_fits_agree_with_a_loop_of_fits(spectra, programs):
    with jax.enable_x64(True):
        problem = pl.fitting.prepare(spectra[0], FREE)
        solve = jax.jit(
            jax.vmap(lambda values, start: pl.fitting.solve(problem.with_data(values), start), (0, None))
        )
        values = np.stack([spectrum.values for spectrum in spectra])
        found = jax.device_get(solve(values, starts(problem)))
        programs.clear()
        again = solve(values[::-1], starts(problem) + 1e-3)
        jax.block_until_ready(again)
        assert programs == []
    assert found.values.shape == (3, 2, 2)
    assert found.deviance.shape == found.converged.shape == found.steps.shape == (3, 2)
    assert found.converged.all()
    for spectrum, values in zip(spectra, found.values, strict=True):
        fit = pl.fit(spectrum, FREE)
        assert np.allclose(values, [fit[name].value for name in problem.names], rtol=1e-5, atol=0)


@pytest.mark.slow
def test_prepared_problems_stack_and_deviances_are_chi_squared(spectra):
    """The deviance of a spectrum with given σ is χ², up to the same constant at every start."""
    with jax.enable_x64(True):
        problems = [pl.fitting.prepare(spectrum, FREE) for spectrum in spectra]
        stack = jax.tree.map(lambda *x: jnp.stack(x), *problems)
        found = jax.vmap(pl.fitting.solve, (0, None))(stack, starts(problems[0]))
    assert stack.lower.shape == (3, 2)
    for i, spectrum in enumerate(spectra):
        best = dict(zip(problems[0].names, np.asarray(found.values)[i, 0].tolist(), strict=True))
        model = pl.simulate(film(best["A"], best["thickness"]), NM).values
        chi2 = np.sum(((spectrum.values - model) / 0.002) ** 2)
        assert np.allclose(found.deviance[i, 0], chi2, rtol=1e-6)


@pytest.mark.slow  # compiles for 2 s
def test_other_sigma_weighs_points(spectra):
    """Points of huge σ do not count: the rest alone gives the same thickness."""
    sigma = np.where(NM < 700, 0.002, 1e6)
    half = pl.Spectrum(NM[NM < 700], spectra[0].values[NM < 700], "R", sigma=np.full(sum(NM < 700), 0.002))
    with jax.enable_x64(True):
        whole, part = pl.fitting.prepare(spectra[0], FREE), pl.fitting.prepare(half, FREE)
        found = pl.fitting.solve(whole.with_data(spectra[0].values, sigma), starts(whole)[:1])
        expected = pl.fitting.solve(part, starts(part)[:1])
    assert np.allclose(found.values, expected.values, rtol=1e-6)


def test_wrong_shapes_are_refused(spectra, refuses):
    problem = pl.fitting.prepare(spectra[0], FREE)
    refuses(ValueError, r"\(120,\), got \(3,\)", problem.with_data, np.zeros(3))
    refuses(ValueError, "2 parameters", pl.fitting.solve, problem, [500.0, 1.5])
    free = pl.Scene(FREE.layers, 3.9, light=pl.Light(angle=70.0, signal="psi-delta"))
    with pytest.raises(UsageError, match="prepare and stack"):
        pl.fitting.prepare(pl.simulate(free, NM), free).with_data(np.zeros(120))


@pytest.mark.slow
def test_a_second_fit_of_the_same_kind_compiles_nothing(programs):
    """Other data, wavelengths, number of points, noise, bounds and constants; the padded length is one."""
    one = pl.simulate(film(1.5, 300.0), NM, noise=0.002)
    other = pl.simulate(film(1.46, 520.0, 2000.0, 3.7), NM[3:] + 7.0, noise=0.005, seed=1)
    jax.jit(lambda x: x + 1)(1.0)
    assert programs  # the listener listens
    pl.fit(one, FREE)
    programs.clear()
    fit = pl.fit(other, film(pl.Free(1.3, 1.8), pl.Free(20, 800), 2000.0, 3.7))
    assert abs(fit["thickness"].value - 520) < 5 * fit["thickness"].stderr
    assert programs == []
