"""solcore: the critical points of S. Adachi in `Custom_CPPB`, as functions of the energy in eV."""

import numpy as np
from solcore.absorption_calculator.cppm import Custom_CPPB

HC = 1239.841984


def values(case):
    """Return the real and imaginary parts of the permittivity."""
    energy, model = HC / np.array(case["wavelength"]), Custom_CPPB()
    if case["model"] == "adachi-m0":
        given = {"A": case["A"], "E0": case["E0"], "E0_d0": case["E0_d0"]}
        epsilon = model.E0andE0_d0(energy, Gamma_E0=case["gamma"], Alpha_E0=0, **given)
    else:
        given = {key: case[key] for key in ("B1", "B1s", "E1", "E1_d1")}
        epsilon = model.E1andE1_d1(energy, None, Gamma_E1=case["gamma"], Alpha_E1=0, **given)
    return {"re": epsilon.real, "im": epsilon.imag}
