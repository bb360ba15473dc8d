"""pyElli: `dielectric_function` of its dispersions, in nm."""

import elli
import numpy as np


def values(case):
    """Return the real and imaginary parts of the permittivity."""
    if case["model"] == "tanguy":
        law = elli.Tanguy(A=case["A"], d=3, gamma=case["gamma"], R=case["R"], Eg=case["Eg"])
    else:
        law = elli.Poles(A_ir=-case["A_ir"], A_uv=case["A_uv"], E_uv=case["E_uv"])
    epsilon = np.asarray(law.dielectric_function(np.array(case["wavelength"])), complex)
    return {"re": epsilon.real, "im": epsilon.imag}
