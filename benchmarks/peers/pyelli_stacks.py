"""Jones matrices of stacks by pyElli's 4×4 solver: stacks as JSON on stdin, matrices as JSON on stdout.

Started by `agreement.py` with the Python of the packages' environment; needs nothing else of this repository.
"""

import json
import sys
import warnings

import elli
import numpy as np


def medium(indices, turns):
    """Return a medium of given principal indices, each (re, im), and Euler angles in degrees."""
    n = [elli.ConstantRefractiveIndex(n=complex(*x)) for x in indices]
    if indices[0] == indices[1] == indices[2]:
        return elli.IsotropicMaterial(n[0])
    crystal = elli.BiaxialMaterial(*n)
    about, z, y = elli.rotation_v_theta, [0, 0, 1], [0, 1, 0]
    theta, phi, psi = turns
    crystal.set_rotation(about(z, phi) @ about(y, theta) @ about(z, psi))
    return crystal


def jones_matrix(stack):
    """Return the real and imaginary parts of r_pp, r_ps, r_sp and r_ss."""
    *layers, substrate = [medium(*each) for each in zip(stack["indices"], stack["turns"], strict=True)]
    films = [elli.Layer(*each) for each in zip(layers, stack["depths"], strict=True)]
    ambient = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=stack["ambient"]))
    structure = elli.Structure(ambient, films, substrate)
    found = structure.evaluate([stack["wavelength"]], stack["angle"], solver=elli.Solver4x4)
    return np.ravel(found.jones_matrix_r).view(float).tolist()


def answer(stack):
    """Return the matrix, or eight NaN where pyElli raises."""
    try:
        return jones_matrix(stack)
    except Exception:
        return [float("nan")] * 8


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    json.dump([answer(stack) for stack in json.load(sys.stdin)], sys.stdout)
