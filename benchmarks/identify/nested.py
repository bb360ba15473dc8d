"""Evidence that the data of two layers have for both: that of the truth, less that of the best one film.

A layer that is there can be found only where the data show it: 30 nm of a polymer on nitride in R, with noise
of 1 % and a lamp that is not known, are described as well by one film of alumina.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from suite import Case

import pellicle as pl
from pellicle.identification import films
from pellicle.identification.evidence import weigh
from pellicle.identification.growth import Growth, grow
from pellicle.identification.request import Request, problem_of
from pellicle.identification.search import polished
from pellicle.identification.structure import Material, Structure

STRONG = 5.0
"""Δ ln Z from which a layer must be found: what excludes a hypothesis."""


def gain(case: Case, data: Any) -> float:
    """ln Z of the two layers of a case, as tables and as free indices, less that of the best one film."""
    names = films.chosen(None, None)
    request = Request(
        pl.Substrate(case.stated, back=case.back or None), pl.medium(1.0), pl.Light(), tuple(names)
    )
    problem, _ = problem_of([data], request)
    tables, nm = problem.views[0].tables, case.view.nm
    one = grow(Growth(problem, [x for x in names if x in tables]), layers=1)
    true = []
    for kinds in product((True, False), repeat=len(case.specimen.layers)):
        start, media = [], []
        for layer, table in zip(case.specimen.layers, kinds, strict=True):
            start.append(layer.thickness)
            media.append(Material(layer.material if table else "cauchy", problem.thickest))
            if not table:
                slope, mean = np.polyfit(nm**-2.0, np.real(layer.index(nm)), 1)
                start += [mean, max(slope, 0.0)]
        if all(x.modelled or x.name in tables for x in media):
            true.append(polished(problem, Structure(tuple(media)), [np.array(start)]))
    weighed = weigh(problem, [*one.attempts, *true], {})
    two = [x.ln_z for x in weighed if any(x.attempt is y for y in true)]
    return max(two) - max(x.ln_z for x in weighed if not any(x.attempt is y for y in true))
