"""pellicle in float64: sums of terms of the permittivity."""

import jax
import numpy as np

import pellicle.dispersion as d
from pellicle.dispersion.base import HC

jax.config.update("jax_enable_x64", True)


def values(case):
    """Return the real and imaginary parts of the permittivity."""
    eps_inf, terms = TERMS[case["model"]](case)
    energy = HC / np.array(case["wavelength"])
    parts = [x.epsilon(energy) for x in terms]
    return {
        "re": np.ravel(eps_inf + sum(np.asarray(x.re) for x in parts)),
        "im": np.ravel(sum(np.asarray(x.im) for x in parts) + 0 * energy),
    }


TERMS = {
    "tanguy": lambda c: (1, [d.Tanguy(c["A"], c["Eg"], c["R"], c["gamma"])]),
    "poles": lambda c: (0, [d.UVPole(c["A_uv"], c["E_uv"]), d.IRPole(c["A_ir"])]),
    "gold": lambda c: (
        1,
        [
            d.Drude(c["plasma"] * c["f0"] ** 0.5, c["gamma0"]),
            *(d.BrendelBormann(f * c["plasma"] ** 2, *rest) for f, *rest in c["gold"]),
        ],
    ),
    "adachi-m0": lambda c: (
        0,
        [d.AdachiM0(c["A"], c["E0"], c["gamma"]), d.AdachiM0(c["A"] / 2, c["E0_d0"], c["gamma"])],
    ),
    "adachi-m1": lambda c: (
        0,
        [d.AdachiM1(c["B1"], c["E1"], c["gamma"]), d.AdachiM1(c["B1s"], c["E1_d1"], c["gamma"])],
    ),
}
"""The constant and the terms of each model."""
