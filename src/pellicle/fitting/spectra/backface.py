"""What the back face of a plate is worth: the same fit without it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from pellicle.fitting.spectra.evaluation import Local, local
from pellicle.fitting.spectra.problem import Problem, View, make
from pellicle.fitting.spectra.reweighting import RankedMinima
from pellicle.fitting.spectra.search import polished, quiet
from pellicle.fitting.spectra.targets import Measured
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves


class Worth(NamedTuple):
    """rms of the spectra that see a back face, with it and without: fractions, or degrees of Ψ where all
    are ellipsometry."""

    rms: float
    without: float


def worth(spectra: Sequence[Measured], weighed: RankedMinima) -> Worth | None:
    """How well substrates as half spaces would fit, from the same minima.

    None where no plate has a back face, or where it has free parameters: without it they would have
    no meaning.
    """
    seen = [i for i, view in enumerate(weighed.problem.views) if view.plan.on("back-face")]
    seen = [i for i in seen if weighed.problem.views[i].channels == 1] or seen
    backs = [spectra[i].scene.substrate for i in seen]
    if not seen or any(free_leaves((plate.back, plate.plate_mm)) for plate in backs):
        return None
    views = zip(spectra, weighed.problem.views, strict=True)
    without = make(*(_bare(spectrum, view) for spectrum, view in views))
    best = polished(without, weighed.minima.units, quiet).units[0]
    at = [_at(without, i, best) for i in seen]
    return Worth(
        _rms([weighed.problem.views[i] for i in seen], [weighed.met[i].at for i in seen]),
        _rms([without.views[i] for i in seen], at),
    )


def _bare(spectrum: Measured, view: View) -> Measured:
    """The spectrum as it was weighed, of a sample without a back face."""
    sigma = 1 / view.data.weight[: view.points].reshape(view.rows, view.channels)
    return spectrum._replace(
        scene=_half_space(spectrum.scene),
        sigma=sigma,
        independent_fraction=float(view.data.independent_fraction),
    )


def _half_space(scene: Scene) -> Scene:
    return eqx.tree_at(
        lambda s: s.substrate.back, scene, None, is_leaf=lambda x: x is None or x is scene.substrate.back
    )


def _at(problem: Problem, which: int, unit: np.ndarray) -> Local:
    view = problem.views[which]
    return jax.device_get(local(*view.program, unit[list(view.takes)]))


def _rms(views: Sequence[View], at: Sequence[Local]) -> float:
    squares = [view.rms(there.model) ** 2 for view, there in zip(views, at, strict=True)]
    return float(np.sqrt(np.average(squares, weights=[view.points for view in views])))


def told(found: Worth | None) -> str:
    """A sentence for the verdict."""
    if found is None:
        return ""
    rms, without = found
    if without > 1.05 * rms:
        return f" The back face matters: rms {rms:.4f} with it, {without:.4f} without."
    if rms > 1.05 * without:
        return f" The back face does harm: rms {rms:.4f} with it, {without:.4f} without."
    return f" The back face makes no difference here: rms {rms:.4f} with it, {without:.4f} without."
