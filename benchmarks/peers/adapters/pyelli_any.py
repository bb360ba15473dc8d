"""pyElli: `Structure.evaluate`, nanometres and degrees, n + ik."""

import elli


def values(case, solver):
    """Return R and T computed with one of its solvers."""

    def medium(n, k):
        return elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=complex(n, k)))

    structure = elli.Structure(
        medium(case["ambient_n"], 0.0),
        [elli.Layer(medium(case["layer_n"], case["layer_k"]), case["thickness"])],
        medium(case["substrate_n"], case["substrate_k"]),
    )
    answer = structure.evaluate([case["wavelength"]], case["angle"], solver=solver)
    return {
        kind + letter: [getattr(answer, f"{kind}_{letter}{letter}")[0]] for kind in "RT" for letter in "sp"
    }
