"""Mueller matrices against their definition by Pauli matrices, and against N, C, S of isotropic samples."""

import jax
import numpy as np
import pytest

from pellicle.optics.coherent import responses
from pellicle.optics.ellipsometry import mueller, normalised, normalised_mueller, stokes
from pellicle.optics.pair import to_complex

# S₁ = |E_p|² − |E_s|², S₂ = 2 Re(E_p conj E_s), S₃ = 2 Im(E_p conj E_s)
PAULI = [np.eye(2), np.diag([1, -1]), np.array([[0, 1], [1, 0]]), np.array([[0, 1j], [-1j, 0]])]


@pytest.fixture(scope="module")
def jones():
    rng = np.random.default_rng(7)
    return rng.normal(size=(5, 2, 2)) + 1j * rng.normal(size=(5, 2, 2))


def test_definition(jones):
    expected = [
        [[0.5 * np.trace(out @ j @ into @ j.conj().T).real for into in PAULI] for out in PAULI] for j in jones
    ]
    np.testing.assert_allclose(mueller(jones), expected, rtol=0, atol=1e-14)


def test_isotropic_sample():
    s, p = responses(1.0, [1.6 + 0.1j], 3.9 + 0.02j, [np.asarray(1.2)], np.asarray(1.1))
    n, c, sine = normalised(stokes(s, p))
    rs, rp = (to_complex(x.reflected) / to_complex(x.denominator) for x in (s, p))
    found = normalised_mueller(mueller(np.diag([rp, rs])))
    expected = [[1, -n, 0, 0], [-n, 1, 0, 0], [0, 0, c, sine], [0, 0, -sine, c]]
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_dark_sample_has_finite_slopes():
    def first_row(scale):
        return normalised_mueller(mueller(scale * np.eye(2, dtype=complex)))[0].sum()

    assert first_row(0.0) == 0
    assert np.isfinite(jax.jit(jax.grad(first_row))(0.0))
    np.testing.assert_allclose(first_row(1e-100), 1)
