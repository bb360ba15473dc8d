"""PyMoosh: `models.BrendelBormann`, eV and nm."""

import numpy as np
from PyMoosh.models import BrendelBormann


def values(case):
    """Return the real and imaginary parts of the permittivity."""
    f, omega, gamma, sigma = np.transpose(case["gold"])
    given = case["f0"], case["plasma"], case["gamma0"]
    epsilon = BrendelBormann(np.array(case["wavelength"]), *given, f, omega, gamma, sigma)
    return {"re": epsilon.real, "im": epsilon.imag}
