"""Comparison of fits of the same data by their evidence, and by information criteria.

The evidence Z is the likelihood L averaged over the priors of all free numbers, by Laplace's approximation;
in L, scale, offset and systematic effects are integrated out, and all fits have one noise
(`fitting.marginal`). With k the free numbers and n the points that count,
AIC = −2 ln L + 2 k (H. Akaike 1974, IEEE Trans. Automat. Contr. 19, 716) and
BIC = −2 ln L + k ln n (G. Schwarz 1978, Ann. Stat. 6, 461).

Where effects and not the noise set the error of a number, it is as uncertain as by fewer points, which stand
for n: information, not points, is what the prior of this criterion counts (R. Kass and L. Wasserman 1995, J.
Am. Stat. Assoc. 90, 928).
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from logging import getLogger
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.curves import BIREFRINGENCE
from pellicle.fitting.linear_system import Effect, Evidence
from pellicle.fitting.marginal import Ranking, by_remaining, left_weights, marginal
from pellicle.fitting.noise import student
from pellicle.fitting.report_methods import ReportMixin
from pellicle.fitting.result import Estimate, Fit, Part, Status
from pellicle.fitting.status import REFUSED
from pellicle.forward_model.plan import GENERAL
from pellicle.scene.film import Scene

log = getLogger(__name__)

UNDECIDED, STRONG = 1.0, 5.0
"""Δ ln Z below which two descriptions cannot be distinguished, and from which the evidence is very strong (R.
Kass and A. Raftery 1995, J. Am. Stat. Assoc. 90, 773)."""


_CLEAR = 3.5
"""Total errors by which one of the further numbers differs from 0 where the evidence for them is strong."""
_COMPATIBLE = 1.96
"""Standard errors within which a number is compatible with 0, at 95 %."""


_FEWEST = math.e**2
"""Points that a number costs at least: as much as AIC charges."""


AXIS, TILTED = "axis_", "a tilted optic axis"
"""Part of the names of an optic axis's angles, and what stands for them beside an aligned axis."""


_UNSEEN_BIREFRINGENCE = 0.1
"""Error of a birefringence that data do not show: few crystals have more."""


@dataclass(frozen=True)
class Candidate:
    """One description and its fit; `free` counts what was fitted, `deviance` is −2 ln L, and `log_evidence`
    is ln Z with the noise that all candidates have here."""

    name: str
    fit: Fit
    free: int
    deviance: float
    aic: float
    bic: float
    log_evidence: float


@dataclass(frozen=True, repr=False)
class Comparison(ReportMixin):
    """Candidates in the order given, and the effective points."""

    candidates: tuple[Candidate, ...]
    effective_points: float

    @property
    def best(self) -> Candidate:
        """The one of most evidence."""
        return max(self.candidates, key=lambda c: c.log_evidence)

    @property
    def probabilities(self) -> dict[str, float]:
        """Posterior probability of each candidate by name, where all are as probable beforehand."""
        best = self.best.log_evidence
        odds = {c.name: math.exp(c.log_evidence - best) for c in self.candidates}
        return {name: own / sum(odds.values()) for name, own in odds.items()}

    @property
    def verdict(self) -> str:
        """Verdict on the two best candidates, and the parameters or effects in which they differ."""
        best, second, *_ = sorted(self.candidates, key=lambda c: -c.log_evidence)
        apart = best.log_evidence - second.log_evidence
        more, less = _extra(best.fit, second.fit), _extra(second.fit, best.fit)
        birefringent = [_matrices(one.fit) > 0 for one in (best, second)]
        if birefringent[0] != birefringent[1]:
            # its indices have other names than the one that they stand for
            more, less = [["birefringence"] if one else [] for one in birefringent]
        elif (tilted := [_matrices(one.fit) >= GENERAL for one in (best, second)])[0] != tilted[1]:
            named = [[name for name in names if AXIS not in name] for names in (more, less)]
            more, less = [
                [*names, TILTED] if one else names for names, one in zip(named, tilted, strict=True)
            ]
        verb = "strongly favour" if apart >= STRONG and _beyond_errors(best.fit, second.fit) else "favour"
        if apart < UNDECIDED:
            sentence = f"The data do not distinguish {best.name} from {second.name} (Δ ln Z {apart:.1f})"
            if best.free != second.free:
                simpler = min((best, second), key=lambda c: c.free)
                sentence += f": prefer {simpler.name}, which has fewer free parameters"
        else:
            sentence = f"{best.name} is better than {second.name} by Δ ln Z {apart:.3g}: "
            if less and not more:
                sentence += f"{' and '.join(less)} {'is' if len(less) == 1 else 'are'} not needed"
            else:
                rather = f" rather than {' and '.join(less)}" if less else ""
                sentence += f"the data {verb} {' and '.join(more) or 'its materials'}{rather}"
            if birefringent == [True, False]:
                sentence += _size_of_birefringence(best.fit)
            elif birefringent == [False, True]:
                birefringence = _clearest_birefringence(second.fit)
                unseen = birefringence is not None and birefringence[2] > _UNSEEN_BIREFRINGENCE
                sentence += ", and these data would not show it" if unseen else ""
        if best.fit.status is Status.MISFIT:
            return f"{sentence}. But even {best.name} does not explain the data."
        if best.fit.status is not Status.CONVERGED:
            return f"{sentence}. But the fit of {best.name} is {best.fit.status}."
        return f"{sentence}."

    def __str__(self) -> str:
        best = self.best.log_evidence
        rows = [f"  {c.name}: ln Z {c.log_evidence - best:+.1f}, {c.fit.status}" for c in self.candidates]
        return "\n".join([self.verdict, *rows])

    __repr__ = __str__


def compare(fits: Mapping[str, Fit]) -> Comparison:
    """Compare fits, by name, of the same data. Raises UsageError where they are not of the same data."""
    if len(fits) < 2:
        raise UsageError("a comparison needs two descriptions or more")
    check_same({name: [part.data for part in fit.parts] for name, fit in fits.items()})
    if len({fit.layer_test and fit.layer_test.residual for fit in fits.values()}) > 1:
        raise UsageError(f"{' and '.join(fits)} have different residuals: give all the same")
    with jax.enable_x64(True):
        explained = dict(zip(fits, _explained([fit.ranking for fit in fits.values()]), strict=True))
        nearest = max(explained.values(), key=lambda one: one.information)
        points, weights = nearest.points, nearest.weights
        wider = float(student(nearest.best.ranked.freedom, STRONG)) ** 2
        both = {name: one.likelihood(weights, fits[name].parts) for name, one in explained.items()}
    # where few residuals set the noise, differences in χ² count less
    deviances = {name: deviance / wider for name, (deviance, _) in both.items()}
    candidates = []
    for name, fit in fits.items():
        free, deviance = len(fit.free), deviances[name]
        bic = deviance + sum(math.log(max(points * _share(p), _FEWEST)) for p in fit.free)
        evidence = both[name][1] + 0.5 * (both[name][0] - deviance)
        log.info(
            "comparison: %s has %d free parameters and -2 ln L %.6g on %.4g points: ln Z %.6g, BIC %.6g",
            *(name, free, deviance, points, evidence, bic),
        )
        candidates.append(Candidate(name, fit, free, deviance, deviance + 2 * free, bic, evidence))
    return Comparison(tuple(candidates), points)


def best_explained(names: Iterable[str], fit: Callable[[str, bool], Fit]) -> Comparison:
    """Compare the fits that `fit(name, explained)` makes; only the best is explained, where it misfits.

    Trials of usual mistakes take longer than the fits. Raises UsageError as `compare` does.
    """
    fits = {name: fit(name, False) for name in names}
    comparison = compare(fits)
    best = comparison.best
    if best.fit.status not in REFUSED:
        return comparison
    return compare(fits | {best.name: fit(best.name, True)})


def check_same(measured: Mapping[str, Sequence[Any]]) -> None:
    """Raise UsageError where the data of descriptions, by their name, differ in points, signal or noise."""

    def about(parts: Sequence[Any]) -> tuple[list[object], list[np.ndarray | None]]:
        columns: list[np.ndarray | None] = []
        names: list[object] = []
        for data in parts:
            names += [type(data), data.kind if isinstance(data, Spectrum) else ""]
            light = "angle" if isinstance(data, Colours) else "theta_i phi_i theta_o phi_o"
            if isinstance(data, Spectrum):
                light = "wavelength azimuth delta delta_sigma depolarisation depolarisation_sigma"
            columns += [getattr(data, name) for name in ("values", "sigma", *light.split())]
        return names, columns

    (first, names, columns), *others = ((name, *about(parts)) for name, parts in measured.items())
    for other, other_names, other_columns in others:
        if names != other_names or not all(map(_equal, columns, other_columns)):
            raise UsageError(
                f"{first} and {other} do not use the same points with the same noise: give both the same"
                " range, noise and signal, or their criteria mean nothing"
            )


def _equal(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    return one is other if one is None or other is None else np.array_equal(one, other)


class _Explained(NamedTuple):
    """The best minimum of a fit and its evidence."""

    best: Ranking
    evidence: list[Evidence]

    @property
    def weights(self) -> list[np.ndarray]:
        """1/σ of the points of each view (rows, channels), where σ is what the effects leave."""
        return left_weights(self.evidence, self.best.discrepancy)

    @property
    def information(self) -> tuple[int, float]:
        """Channels of all views, and the logarithm of these weights, added over all points."""
        channels = sum(own.shape[1] for own in self.weights)
        return channels, sum(float(np.sum(np.log(np.maximum(own, 1e-300)))) for own in self.weights)

    @property
    def points(self) -> float:
        """Independent points."""
        ranked = by_remaining(self.best.ranked, self.best.discrepancy)
        pairs = zip(ranked.problem.views, ranked.fits, strict=True)
        return sum(view.independent / max(fit.variance, 1.0) for view, fit in pairs)

    def likelihood(self, weights: Sequence[np.ndarray], parts: Sequence[Part]) -> tuple[float, float]:
        """−2 ln of the marginal likelihood and ln of the evidence, up to a constant, with these weights.

        A depolarisation that the scene has not is a residual as a whole.
        """
        missed, best = 0.0, self.best
        for view, own, part in zip(self.evidence, weights, parts, strict=True):
            known = view.residual.shape[-1]
            if known < own.shape[1] and (share := part.spectrum.kind.share):
                missed += float(np.sum((own[:, known:] * share.measured(part.spectrum)[:, None]) ** 2))
        known = [own[:, : view.residual.shape[-1]] for view, own in zip(self.evidence, weights, strict=True)]
        about = self.evidence, best.jacobian, best.ranked.minima.units[0], known, best.discrepancy.total
        found = marginal(*about)
        return missed + float(found.deviance), float(found.log_evidence) - 0.5 * missed


def _explained(every: Sequence[Ranking]) -> list[_Explained]:
    """Evidence of each candidate, with the effects that all of them leave out.

    One that a candidate describes is what the comparison is about: the others have it not at all.
    """
    evidence = [best.evidence() for best in every]
    common = shared_effects([[effect for view in own for effect in view.effects] for own in evidence])
    return [
        _Explained(best, [view._replace(effects=[*filter(common, view.effects)]) for view in own])
        for best, own in zip(every, evidence, strict=True)
    ]


def shared_effects(every: Sequence[Sequence[Effect]]) -> Callable[[Effect], bool]:
    """Return a test for effects of a kind that each of several descriptions leaves out."""
    # one layer and several name an effect with and without its layer: `index of the layer`, `index of film`
    common = set.intersection(*({effect.name.split(" of ")[0] for effect in own} for own in every))
    return lambda effect: effect.name.split(" of ")[0] in common


def _matrices(fit: Fit) -> int:
    """Size of the matrices of anisotropic media, 0 where nothing is birefringent."""
    rows = (row for part in fit.parts for row in part.plan.rows if row.effect == "anisotropy")
    return max((row.count * row.on for row in rows), default=0)


def _clearest_birefringence(fit: Fit) -> tuple[float, float, float] | None:
    """Wavelength (nm) at which the fitted birefringence is largest against its error, and both there; None
    where it was not fitted or the layer is biaxial."""
    indices = fit.principal_indices.get(BIREFRINGENCE)
    if indices is None or not np.all(indices.n_stderr > 0):
        return None
    i = int(np.argmax(np.abs(indices.n) / indices.n_stderr))
    return float(indices.wavelength[i]), float(indices.n[i]), float(indices.n_stderr[i])


def _size_of_birefringence(fit: Fit) -> str:
    """Words on the fitted birefringence where it is largest against its error."""
    if (birefringence := _clearest_birefringence(fit)) is None:
        return ""
    wavelength, n, error = birefringence
    doubt = ": by noise alone it is there, but usual errors of instruments and samples would imitate it"
    return f", {n:.3g} ± {error:.2g} at {wavelength:g} nm{doubt if abs(n) <= _COMPATIBLE * error else ''}"


def _beyond_errors(one: Fit, other: Fit) -> bool:
    """True unless all numbers that only the first fits are within `_CLEAR` of their total errors of 0."""
    further = [p for p in one.free if p.name not in {q.name for q in other.free}]
    return not further or any(abs(p.value) > _CLEAR * p.stderr for p in further)


def _share(number: Estimate) -> float:
    """Information on a number that effects leave, as a share of that by noise alone."""
    if not math.isfinite(number.stderr):
        return 0.0
    return (number.stderr_noise / number.stderr) ** 2 if number.stderr > 0 else 1.0


def _layers(fit: Fit) -> list[str]:
    """Names of the layers of a film, or of their materials."""
    scene = fit.scene[0] if isinstance(fit.scene, tuple) else fit.scene
    if not isinstance(scene, Scene):
        return []
    return [layer.name or getattr(getattr(layer, "material", None), "name", "") for layer in scene.layers]


def _extra(one: Fit, other: Fit) -> list[str]:
    """Layers that only the first has, else names of free parameters, else of effects that it simulates."""
    more, less = _layers(one), _layers(other)
    layers = [name for name in more if name and name not in less]
    if layers and len(layers) == len(more) - len(less):
        return [f"the layer `{name}`" for name in layers]
    # the numbers of an only layer are not named for it
    single = len(more) == 1 < len(less)
    known = {q.name.split(".")[-1] if single else q.name for q in other.free}
    names = [p.name for p in one.free if p.name not in known]
    if names:
        return names[:4]
    on = [{row.effect for row in part.plan.rows if row.on} for fit in (one, other) for part in fit.parts[:1]]
    return [
        effect for effect in ("roughness", "back-face", "absorption", "coherence") if effect in on[0] - on[1]
    ]
