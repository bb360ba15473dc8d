"""difftmm: `create_jones_matrix_isotropic`, micrometres and radians, complex64 by construction.

Its matrices belong to the time factor exp(+iωt), so absorption is n − ik: with n + ik, as in its
documentation, a film amplifies. It returns amplitudes; R is their square.
"""

import torch
from difftmm import create_jones_matrix_isotropic

from adapters.by_torch import by_autograd, leaves


def _signals(p):
    layer, outside = (torch.complex(n, -k) for n, k in (p["layer"], p["substrate"]))
    _, _, rs, rp = create_jones_matrix_isotropic(
        layer.reshape(1, 1),
        (p["thickness"] * 1e-3).reshape(1, 1),
        (p["wavelength"] * 1e-3).reshape(1, 1),
        p["ambient_n"].detach().to(torch.complex64).reshape(1, 1),
        outside.reshape(1, 1),
        torch.deg2rad(p["angle"]).reshape(1, 1),
    )
    return {"R" + letter: (r.abs() ** 2).reshape(()) for letter, r in (("s", rs), ("p", rp))}


def values(case):
    return {signal: [x.item()] for signal, x in _signals(leaves(case, torch.float32)).items()}


def slopes(case):
    return by_autograd(_signals, case, torch.float32)
