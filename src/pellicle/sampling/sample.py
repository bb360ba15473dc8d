"""Sample the posterior of a fit's free parameters, by an ensemble of walkers from every minimum found.

A chain is extended until its checks pass, a limit is reached, or the user interrupts.
"""

import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from logging import getLogger
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.measurement import Measurement
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError, install_command
from pellicle.fitting import joint
from pellicle.fitting.brdf import fit as brdf
from pellicle.fitting.brdf.summary import BrdfMeasurements
from pellicle.fitting.discrepancy import discrepancy
from pellicle.fitting.film import fit as spectra
from pellicle.fitting.film.colour_measurements import arrays
from pellicle.fitting.film.summary import FilmMeasurements
from pellicle.fitting.marginal import by_remaining, with_shift
from pellicle.fitting.progress import Progress
from pellicle.fitting.result import Fit, Status
from pellicle.fitting.reweighting import RankedMinima, at_minimum, linearised
from pellicle.sampling import density
from pellicle.sampling.chain import Chain, ChainFile, Checks, check, missing
from pellicle.sampling.result import Posterior, Prediction, predictions
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

log = getLogger(__name__)

BLOCK = 100
"""Steps between two looks at the clock and the keyboard."""
_GROWTH = 1.25
"""The checks are made again when the chain has grown by this factor."""


def run(
    target: density.Target,
    modes: density.Modes,
    chain: Chain,
    steps: int,
    keep: Callable[[Chain], None],
    progress: Progress,
) -> tuple[Chain, Checks]:
    """The chain extended to at most `steps`, and its checks.

    `keep` is called with the chain after every block. Ctrl-C ends the chain with what it has; before the
    first block it is raised again.
    """
    checks, checked = None, 0
    progress("sample", chain.steps, steps)
    try:
        while chain.steps < steps:
            if chain.steps >= 2 * BLOCK and chain.steps >= _GROWTH * checked:
                checks, checked = check(chain, modes), chain.steps
                log.info("chain: %d steps: %s", chain.steps, "; ".join(checks.doubts) or "long enough")
                if checks.trusted:
                    break
            chain = _extended(target, modes, chain, min(BLOCK, steps - chain.steps))
            keep(chain)
            progress("sample", chain.steps, steps)
        progress("sample", chain.steps, chain.steps)
    except KeyboardInterrupt:
        if not chain.steps:
            raise
    if checks is None or chain.steps != checked:
        checks = check(chain, modes)
    return chain, checks


def _extended(target: density.Target, modes: density.Modes, chain: Chain, steps: int) -> Chain:
    import emcee

    walkers, size = chain.draws.shape[1:]
    if chain.steps:
        state = emcee.State(chain.draws[-1], log_prob=chain.log_density[-1], random_state=chain.random)
    else:
        random = np.random.RandomState()
        random.set_state(chain.random)
        start = modes.start(walkers, random)
        state = emcee.State(start, log_prob=target(start), random_state=random.get_state(legacy=True))
    sampler = emcee.EnsembleSampler(walkers, size, target, moves=moves(modes), vectorize=True)
    # emcee's wrapper prints to stdout where the target is interrupted
    sampler.log_prob_fn = target  # pyright: ignore[reportAttributeAccessIssue]
    sampler.run_mcmc(state, steps, skip_initial_state_check=True)
    more = Chain(
        np.asarray(sampler.get_chain()),
        np.asarray(sampler.get_log_prob()),
        np.asarray(sampler.backend.accepted),
        tuple(sampler.random_state),
    )
    return chain.extended(more)


def moves(modes: density.Modes) -> list[tuple[Any, float]]:
    """emcee's moves with their shares.

    Differential evolution (C. J. F. ter Braak, 2006, Stat. Comput. 16, 239) and its snooker update (ter
    Braak and Vrugt, 2008, ibid. 18, 435) need no tuning, but rarely cross from one minimum to another.
    The third proposes a draw from the mixture of all minima, whatever the walker's place (an independence
    sampler: Tierney, 1994, Ann. Stat. 22, 1701, section 2.3.3).
    """
    from emcee.moves import DEMove, DESnookerMove, MHMove

    def jump(walkers: np.ndarray, random: np.random.RandomState) -> tuple[np.ndarray, np.ndarray]:
        there = modes.draw(len(walkers), random)
        return there, modes.log_density(walkers) - modes.log_density(there)

    return [(DEMove(), 0.4), (DESnookerMove(), 0.1), (MHMove(jump), 0.5)]


STEPS = 20_000
"""Maximum number of steps of a chain."""
FEWEST_WALKERS = 32
_LIVE = 40
"""Numbers of float64 that one point of the data of one walker keeps alive at once, roughly."""


_MATTERS = 1e-4
"""Share of the posterior from which a minimum has systematic effects of its own."""


class Subject(NamedTuple):
    """A finished fit and the posterior of its parameters, in the unit cube of their bounds.

    `values` takes points of the cube to the parameters' own units; `fingerprint` identifies the problem;
    `points` how many data one evaluation compares; `predict` makes predictions of draws, from a seed;
    `stretch` widens draws to the covariance of the fit.
    """

    fit: Fit
    names: tuple[str, ...]
    log_density: density.LogDensity
    modes: density.Modes
    values: Callable[[np.ndarray], np.ndarray]
    fingerprint: str
    points: int
    predict: Callable[[np.ndarray, int], tuple[Prediction, ...]]
    assumption: str = ""
    stretch: density.Stretch = density.unchanged

    def walkers(self, count: int | None, steps: int) -> int:
        """The number of walkers: `count` if it is possible, or four for each parameter and at least 32.

        Raises UsageError where they are too few, or need more than the machine's memory.
        """
        size = len(self.names)
        if count is None:
            return max(FEWEST_WALKERS, 4 * size)
        if count < max(2 * size, 4) or count % 2:
            raise UsageError(f"walkers must be an even number of at least {max(2 * size, 4)}, got {count}")
        try:
            memory = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        except (AttributeError, ValueError, OSError):  # unknown to the system, and so without limit
            memory = float("inf")
        needed = 8.0 * count * (_LIVE * self.points + 3 * steps * (size + 1))
        if needed > memory:
            most = int(count * memory / needed) // 2 * 2
            raise UsageError(
                f"{count} walkers of {steps} steps need about {needed / 2**30:.3g} GiB and the machine has"
                f" {memory / 2**30:.3g}: take {most} at most, or fewer steps"
            )
        return count


def sampled(
    subject: Subject,
    walkers: int | None,
    steps: int,
    seed: int,
    chain: str | os.PathLike[str] | None,
    progress: Progress,
    began: float,
) -> Posterior:
    """Sample a posterior, in float64.

    Walkers start in every minimum in proportion to its share and move by differential evolution, its snooker
    update, and jumps between minima. The chain ends when it is 50 autocorrelation times long and passes the
    other checks, or after `steps`. With a `chain` file it is kept there as it grows, and a run that was cut
    short goes on where it stopped.

    **Raises:** UsageError for too few walkers (two for each parameter at least) or more than the machine's
    memory holds; DataError for a chain of another problem.
    """
    file = ChainFile(chain, subject.fingerprint, subject.names)
    with jax.enable_x64(True):
        count = subject.walkers(walkers, steps)
        target = density.Target(subject.log_density, (count + 1) // 2)
        grown, checks = run(target, subject.modes, file.begin(count, seed), steps, file.keep, progress)
        try:
            file.write(grown)
        except DataError as error:  # of the disk: the chain in memory is complete
            log.warning("%s; this chain cannot be continued", error)
    units = subject.stretch(grown.draws[checks.discard :])
    return Posterior(
        fit=subject.fit,
        names=subject.names,
        draws=np.asarray(subject.values(units)),
        units=units,
        log_density=grown.log_density[checks.discard :],
        modes=subject.modes,
        checks=checks,
        predict=subject.predict,
        seconds=time.perf_counter() - began,
        assumption=subject.assumption,
    )


Kind = TypeVar("Kind")


def subject_of(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    tolerance: float,
    residual: str | None,
    progress: Progress,
    shared: Sequence[str] | None = None,
) -> Subject:
    """Fit as `pellicle.fit` does, and return the posterior between the bounds, in float64.

    Priors are those of the `Free` parameters, uniform between the bounds by default; scale and offset, and
    the systematic effects of the scene's `uncertainty`, are integrated out.

    BRDF samples are taken to have normal errors in the unit of the `residual` (ρ, or its cube root): of the
    given σ, or of the rms of the best fit's residuals. Without a σ the draws are then stretched around their
    minimum to the covariance of the fit, in which each residual stands for its noise (HC3). Where residuals
    are correlated in neighbouring samples the samples count as fewer. A deviation and its azimuth are a
    direction, and all directions are as likely. The posterior assumes that there is a layer, also where the
    fit finds no evidence of one.

    **Raises:** as `fit` does, and UsageError without the sampler's packages.
    """
    if absent := missing():
        raise UsageError(
            f"posteriors need {', '.join(absent)}, not installed here: {install_command('posterior')}"
        )
    rows: Any = data
    scenes: Any = scene
    if isinstance(scene, Surface):
        return _of_surface(data, scene, tolerance, residual, progress)
    if not joint.of_both_kinds(scene):
        return _of_film(data, scene, tolerance, progress, shared)
    fit, ranked = joint.fitted(rows, scenes, tolerance, progress, residual=residual)
    with jax.enable_x64(True):
        kinds = joint.apart(rows, scenes)
        targets = spectra.measurements(kinds.films, kinds.scenes)
        known = [*map(arrays, targets), *_columns(kinds.samples, kinds.surface)]
        identity = density.fingerprint(known, kinds.surface.model, residual, tolerance)
        return _subject(fit, ranked, partial(joint.together, kinds, targets), identity)


def _of_surface(
    data: Any, scene: Surface, tolerance: float, residual: str | None, progress: Progress
) -> Subject:
    measurements = measured((BrdfSamples,), data)
    fit, ranked = brdf.fitted(measurements, scene, tolerance, progress, residual=residual)
    unsure = fit.layer_test and not fit.layer_test.layered and fit.status is not Status.AMBIGUOUS
    rows = [measurements] if isinstance(measurements, BrdfSamples) else measurements
    compared = fit.layer_test.residual if fit.layer_test else ""
    identity = density.fingerprint(_columns(rows, scene), scene.model, compared, tolerance)
    assumption = "there is a layer" if unsure else ""
    with jax.enable_x64(True):
        return _subject(fit, ranked, partial(BrdfMeasurements, rows, scene), identity, assumption)


def _of_film(data: Any, scene: Any, tolerance: float, progress: Progress, shared: Any) -> Subject:
    measurements = measured(OF_A_FILM, data)
    fit, ranked = spectra.fitted(measurements, scene, tolerance, progress, shared=shared)
    with jax.enable_x64(True):
        targets = spectra.measurements(measurements, scene, shared)
        identity = density.fingerprint([arrays(target) for target in targets], tolerance)
        known = partial(FilmMeasurements, spectra.listed(measurements), targets)
        return _subject(fit, ranked, known, identity)


def _columns(samples: Sequence[BrdfSamples], surface: Surface) -> list[tuple[Any, ...]]:
    columns = [(s.theta_i, s.phi_i, s.theta_o, s.phi_o, s.values, s.sigma) for s in samples]
    return [*columns, (dict(surface.numbers), tuple(surface.bands), surface.media)]


def _subject(
    fit: Fit,
    ranked: RankedMinima,
    measurements: Callable[[RankedMinima], Any],
    identity: str,
    assumption: str = "",
) -> Subject:
    """Log posterior of a fit with its systematic effects, its minima and its predictions.

    `measurements` makes those of the fit from its minima, `identity` is the hash of all that the posterior
    depends on, `assumption` what it assumes beyond the fit.
    """
    best = fit.ranking
    ranked = by_remaining(ranked, best.discrepancy).counted
    jacobian, covariance = linearised(ranked)
    data, problem = measurements(ranked), ranked.problem.affine()
    allowed = discrepancy(data.evidence(ranked, jacobian), jacobian, ranked.minima.units[0])
    channels, every = [view.channels for view in problem.views], []
    some = np.flatnonzero(best.share > _MATTERS)
    for i in some.tolist():
        own = at_minimum(ranked, i)
        evidence = data.evidence(own, linearised(own)[0])
        about = evidence, allowed.evidence_shares, channels, len(problem.parameters)
        every.append(density.systematics(*about))
    centre = np.array([ranked.problem.in_affine(unit) for unit in ranked.minima.units[some]])
    effects = density.nearest(every, centre)
    mixture = density.modes(ranked, effects)
    slope = problem.coordinates.slope(problem.box, mixture.centre[0])
    return Subject(
        fit,
        tuple(p.name for p in problem.parameters),
        density.log_density(problem, effects),
        mixture,
        lambda units: problem.values_near(units, ranked.values),
        identity,
        max(view.independent for view in problem.views),
        lambda units, seed: predictions(problem, fit.parts, units, seed),
        assumption,
        density.sandwich_stretch(with_shift(covariance, allowed), slope, mixture),
    )


OF_A_FILM = (Spectrum, Colours)
"""Kinds of data that a `Scene` explains."""


def measured(kinds: tuple[type[Kind], ...], data: Measurement) -> Kind | list[Kind]:
    """The data as one or a list of such kinds. Raises UsageError for another kind."""
    if isinstance(data, kinds):
        return data
    rows: list[Any] = [data] if isinstance(data, Spectrum | Colours | BrdfSamples) else list(data)
    if not all(isinstance(row, kinds) for row in rows):
        raise UsageError("BRDF samples need a Surface, and spectra and colours a Scene")
    return rows
