"""pyElli: `Structure.evaluate` with Solver4x4, a uniaxial layer on a uniaxial substrate."""

import elli
import numpy as np


def _crystal(ordinary, extraordinary, theta, phi):
    index = elli.ConstantRefractiveIndex
    crystal = elli.UniaxialMaterial(index(n=ordinary), index(n=extraordinary))
    about = elli.rotation_v_theta
    crystal.set_rotation(about([0, 0, 1], phi) @ about([0, 1, 0], theta))
    return crystal


def values(case):
    layer = _crystal(
        complex(case["ordinary_n"], case["ordinary_k"]),
        complex(case["extraordinary_n"], case["extraordinary_k"]),
        case["theta"],
        case["phi"],
    )
    below = [complex(case["substrate_" + x], case["substrate_k"]) for x in ("ordinary", "extraordinary")]
    if below[0] == below[1]:
        substrate = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=below[0]))
    else:
        substrate = _crystal(*below, case["substrate_theta"], case["substrate_phi"])
    ambient = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=case["ambient"]))
    structure = elli.Structure(ambient, [elli.Layer(layer, case["thickness"])], substrate)
    found = structure.evaluate([case["wavelength"]], case["angle"], solver=elli.Solver4x4)
    return {"r": np.ravel(found.jones_matrix_r).view(float)}
