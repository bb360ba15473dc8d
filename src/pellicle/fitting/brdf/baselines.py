"""What a layer must beat: the same surface without interference, and two plain lobes with no layer at all.

On PTFE, which has no film, interference halves the error of a fit: a small misfit proves nothing. On
paints with flakes two lobes of microfacets fit better than either layered model.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.brdf import lobes
from pellicle.brdf.directions import cosine_to_half
from pellicle.fitting.brdf.coordinates import Box, Coordinates
from pellicle.fitting.brdf.problem import Problem

_ROUGHNESS = (0.003, 1.0)
_NORMAL = (0.02, 1.0)
_MOST = 100.0


def two_lobes(parameters: Any, i: Any, o: Any) -> Any:
    """A diffuse part and two lobes of GGX microfacets with Schlick's Fresnel, each in its own colour."""
    edge = (1 - cosine_to_half(i, o)) ** 5
    fresnel = parameters["normal"] + (1 - parameters["normal"]) * edge
    rough, smooth = (
        parameters[f"lobe_{k}"] * (lobes.microfacets(i, o, parameters[f"roughness_{k}"]) * fresnel)[:, None]
        for k in (1, 2)
    )
    return rough + smooth + parameters["diffuse"] + jnp.zeros_like(i[:, :1])


def plain(problem: Problem) -> Problem:
    """The same samples, to be fitted with two lobes."""
    names = ("roughness_1", "roughness_2", "normal")
    form = problem.form._replace(
        evaluate=two_lobes,
        coordinates=Coordinates(names, names, (None,) * 3, (True, True, False), None),
        weights=("lobe_1", "lobe_2", "diffuse"),
        each=True,
    )
    lower, upper = np.array([np.log(_ROUGHNESS), np.log(_ROUGHNESS), _NORMAL]).T
    most = np.full(3 * problem.data.values.shape[1], _MOST)
    return problem._replace(form=form, fixed={}, box=Box(lower, upper, np.float64(0.0)), most=most)
