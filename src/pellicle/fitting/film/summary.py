"""Summary of a fit of spectra: scan profile, drift limits, opaque layers, warnings."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.dispersion.empirical import Shifted
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.curves import Curve
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.film import fringes, parts, residual_structure
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.evidence import evidence
from pellicle.fitting.film.indices import indices
from pellicle.fitting.film.parameters import fixed_numbers, thickness_name, tied_numbers
from pellicle.fitting.film.problem import Target, drifts, shortest_wavelength
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.linear_system import Evidence
from pellicle.fitting.noise import local_noise, student
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Estimate, Part, Profile
from pellicle.fitting.reweighting import RankedMinima, ViewFit
from pellicle.fitting.robust_losses import spread
from pellicle.fitting.status import RIVAL
from pellicle.fitting.tied_numbers import TiedNumber
from pellicle.materials import Material, materials_in
from pellicle.scene.film import Scene
from pellicle.scene.free import is_free, remembered
from pellicle.scene.layers import Layer

_RULED_OUT = 1e8
_ABSORBS = 1e-3
"""An extinction above this is what makes a layer opaque."""
_CHANCE = 5.0
"""Standard errors by which a mean square must exceed that of the noise of a depolarisation."""
_WHITE, _OFF = 2.0, 9.0
"""Points over which the residuals of white noise are correlated at most, and the factor on the given σ²
beyond which that is said to be wrong: three times."""
_WITHIN, _NO_ABSORPTION = 3.0, 1e-4
"""Standard errors within which a layer's index is that of the substrate, and an extinction that is none."""
_SPIKE, _FEW, _CARRY = 8.0, 0.05, 0.5
"""Sizes of the bulk of the residuals beyond which a point is a spike, the share of all points that spikes may
be, and the share of the sum of squares that they carry at least."""
_ROUNDED = 0.5
"""Share of the rms of the residuals beyond which the rounding of the data is said."""
_ROUNDING = 1e-6
"""Size of the bulk of residuals, as a share of the largest, below which it is rounding."""
FEWEST_FRINGES = 0.75
"""Fringes that a spectrum must span where scale and offset drift: with fewer, drift can imitate the film.
On real soap films from 510 to 910 nm this is 330 nm, below which no single spectrum was decided."""


@dataclass(frozen=True)
class FilmMeasurements:
    """Spectra and colours of one film, the targets of their fit, and its ranked minima."""

    data: list[Spectrum | Colours]
    targets: list[Target]
    ranked: RankedMinima

    @cached_property
    def silent(self) -> list[fringes.Fringes | None]:
        """Clear fringes of each view that the best fit misses."""
        return fringes.missed(self.ranked.problem, self.ranked.fits, self.ranked.values)

    @cached_property
    def structures(self) -> list[residual_structure.Missed | None]:
        """Structure in the residuals of each view."""
        views = zip(self.ranked.problem.views, self.ranked.fits, strict=True)
        return [residual_structure.missed(view, fit) for view, fit in views]

    def evidence(self, at: RankedMinima, jacobian: Scaled) -> list[Evidence]:
        """Residuals of each view and what may explain them `at` a minimum."""
        return evidence(self.targets, at, jacobian, self.ranked.values)

    def parts(self, discrepancy: Discrepancy) -> tuple[Part, ...]:
        """One part for each measurement."""
        return parts.parts(self.data, self.ranked, discrepancy.errors)

    def missed(self, every: tuple[Part, ...], discrepancy: Discrepancy) -> tuple[Part, ...]:
        """The parts that the scene does not explain."""
        return parts.missed(every, self.ranked, discrepancy, self.silent)

    def fixed(self) -> list[Estimate]:
        """The fixed numbers of the layers and the instruments."""
        return [
            Estimate(name, value, 0.0, unit, value, value, False)
            for target in self.targets
            for name, value, unit in fixed_numbers(target.scene, target.name)
        ]

    def tied(self) -> list[TiedNumber]:
        """The numbers of the scenes that follow free ones, each once."""
        rows = [row for target in self.targets for row in tied_numbers(target.scene, target.name)]
        return list({row.name: row for row in rows}.values())

    def amended(self, parts: tuple[Part, ...], limits: Limits) -> Limits:
        """Limits by what a drift of scale and offset could imitate, and of a layer that is not needed."""
        if self.unneeded(parts):
            return unlimited(limits, self.ranked, True)
        if not all(drifts(m.scene) and len(m.scene.layers) == 1 for m in self.targets):
            return limits
        views = zip(self.ranked.problem.views, self.ranked.fits, strict=True)
        least = np.full(len(limits.stderr), np.inf)
        for view, fit in views:
            own = list(view.takes)
            least[own] = np.minimum(least[own], thinnest(view, fit.at.layer))
        return bounded_by_drift(limits, self.ranked, least)

    def unneeded(self, parts: tuple[Part, ...]) -> str:
        """Sentence where the only layer has the index of the substrate within its error, empty elsewhere: its
        thickness then means nothing, as any or none would do; or where nobody calibrated the camera."""
        if all(isinstance(each, Colours) and not each.calibrated for each in self.data):
            return " The camera is not calibrated: give its `sensitivities` or a photographed `chart`."
        if self.targets[0].scene.sample is not None:
            return ""
        view, curve = self.ranked.problem.views[0], parts[0].curve
        if self.ranked.problem.thickness_axis is None or len(view.scene.layers) != 1:
            return ""
        if not isinstance(curve, Curve) or not np.any(curve.n_stderr > 0):
            return ""
        below = indices(view.scene, self.ranked.problem.seen_by(view, self.ranked.values)).substrate
        index, stderr = np.stack([curve.n, curve.k]), np.stack([curve.n_stderr, curve.k_stderr])
        if not like_substrate(index, stderr, below[: view.rows]):
            return ""
        return " No film is needed: the index of the layer is that of the substrate within its error."


def like_substrate(index: np.ndarray, stderr: np.ndarray, substrate: np.ndarray) -> Any:
    """True (...) where n and k of a layer (..., 2, rows) are those of the substrate, n + ik (rows,), within
    their standard errors."""
    apart = np.abs(index - np.stack([np.real(substrate), np.imag(substrate)]))
    return np.all(apart <= _WITHIN * stderr + [[0.0], [_NO_ABSORPTION]], axis=(-2, -1))


def unlimited(limits: Limits, ranked: RankedMinima, which: Any) -> Limits:
    """Limits with thicknesses of the fits `which` (...) that the data do not determine."""
    depth = np.array([p.key == "thickness" for p in ranked.problem.parameters])
    depth = depth & np.asarray(which)[..., None]
    return Limits(np.where(depth, np.inf, limits.stderr), *(np.where(depth, np.nan, x) for x in limits[1:]))


def scans(ranked: RankedMinima, raised: Sequence[Any]) -> dict[int, Profile]:
    """The scan against the thickness at its position, in χ² on the effective points; none without a free
    one. `raised` of each view multiplies its χ² further."""
    scan, depth = ranked.minima.scan, ranked.problem.thickness_axis
    if scan is None or depth is None:
        return {}
    ratio = []
    for before, after in zip(ranked.searched.views, ranked.problem.views, strict=True):
        old, new = before.data, after.data
        # a robust loss lowers the weights of some points
        more = np.max(new.weight / np.where(old.weight > 0, old.weight, np.inf))
        ratio.append(float(more**2 * new.independent_fraction / old.independent_fraction))
    above = (scan.deviance * np.multiply(ratio, raised)).sum(-1).min(axis=0) / student(
        ranked.freedom, RIVAL
    ) ** 2
    # on their new weights several views together may have their least misfit elsewhere in the scan
    return {depth: Profile(scan.thickness, np.minimum(above - min(above.min(), 0.0), _RULED_OUT))}


def bounded_by_drift(limits: Limits, ranked: RankedMinima, least: Any) -> Limits:
    """Limits with thicknesses below the `least` (..., parameters) that span fringes enough bounded from above
    only."""
    depth = [p.key == "thickness" for p in ranked.problem.parameters]
    thin = np.array(depth) & np.isfinite(limits.stderr) & (ranked.values < least)
    return Limits(np.where(thin, np.inf, limits.stderr), limits.lower, np.where(thin, least, limits.upper))


def thinnest(view: SpectrumView, layer: Any) -> Any:
    """The thickness (nm, (...)) of which a spectrum spans `FEWEST_FRINGES`; `layer` (..., 2 and more, points)
    has n of the layer first."""
    rows = slice(view.rows)
    wavelength, n = np.asarray(view.scene.light.wavelength)[rows], np.asarray(layer)[..., 0, rows]
    return FEWEST_FRINGES / np.maximum(np.ptp(2 * n / wavelength, axis=-1), 1e-12)


def opaque(spectra: Sequence[Target], ranked: RankedMinima) -> frozenset[str]:
    """Names of the thicknesses of layers that absorb at the best fit."""
    return frozenset(
        thickness_name(spectrum.scene, i)
        for spectrum, view in zip(spectra, ranked.problem.views, strict=True)
        for i, k in enumerate(indices(view.scene, ranked.problem.seen_by(view, ranked.values)).k)
        if k is not None and np.median(k) > _ABSORBS
    )


def warnings(films: FilmMeasurements, unclear: Sequence[str]) -> tuple[str, ...]:
    """Warnings that a reader needs before using the numbers; `unclear` is what the data do not determine."""
    spectra, ranked = films.targets, films.ranked
    messages = [sentence for m in spectra for sentence in _cautions(m.scene)]
    scan, finest = ranked.minima.scan, shortest_wavelength(ranked.problem) / 8
    if scan is not None and scan.thickness[1] - scan.thickness[0] > 1.01 * finest:
        messages.append(
            "the bounds of the thickness are so wide that its scan has steps of"
            f" {scan.thickness[1] - scan.thickness[0]:.3g} nm, where fringes call for {finest:.3g}: minima"
            " may be missed; narrow the bounds"
        )
    messages += fringes.disagreement(ranked.problem, films.silent, ranked.values)
    views = zip(spectra, ranked.problem.views, ranked.fits, films.structures, strict=True)
    for spectrum, view, fit, structure in views:
        own = f"{view.name}: " if view.name else ""
        messages += [own + sentence for sentence in _on_the_data(view, fit, structure)]
        if spectrum.scene.light.signal == "T" and spectrum.scene.substrate.back is None:
            messages.append(
                f"{own}transmittance into the substrate, as if the detector were inside it; "
                '`back="air"` makes it a plate'
            )
    messages += _added_to_an_index(spectra[0].scene, ranked)
    return tuple(dict.fromkeys([*messages, *unclear]))


def _on_the_data(
    view: SpectrumView | ColoursView, fit: ViewFit, structure: residual_structure.Missed | None
) -> Iterator[str]:
    """Sentences on the residuals of one view, their noise and their `structure`."""
    length, orders = fit.length, view.plan.row("orders")
    if orders.on and orders.error_bound > max(1e-4, view.plan.tolerance):
        yield f"{orders.count} orders leave an error of up to {orders.error_bound:.1g}: |q| is near 1"
    if length >= 10:
        yield (
            f"residuals are correlated over {length:.0f} points: {view.rows} points count as"
            f" {view.rows / length:.0f}"
        )
    if structure is not None:
        yield f"the model misses structure {structure.words}"
    if words := residual_structure.uneven(view, fit):
        yield words
    spectral = isinstance(view, SpectrumView)
    if spectral and (step := float(view.rounding)) > _ROUNDED * view.rms(fit.at.model):
        yield (
            f"the values are rounded to {step * math.sqrt(12):.1g}, and {step:.2g} of the noise is that:"
            " export more digits"
        )
    white = spectral and view.noise.given and length < _WHITE and structure is None
    if white and not 1 / _OFF < (ratio := fit.chi2 / fit.freedom) < _OFF:
        yield (
            f"residuals are white noise of {math.sqrt(ratio):.2g} times the σ that is given: that is too"
            f" {'small' if ratio > 1 else 'large'}, and errors by the noise with it"
        )
    if fit.outliers:
        yield f"{fit.outliers} of {view.rows} points are outliers that count for less than half"


def spikes(ranked: RankedMinima) -> str:
    """Words on a spectrum of which few points carry most of the residuals; empty where none has such."""
    for view, fit in zip(ranked.problem.views, ranked.fits, strict=True):
        if not isinstance(view, SpectrumView):
            continue
        size = np.max(np.abs(view.residuals(fit.at)), axis=1)
        bulk = spread(size)
        far = size > _SPIKE * bulk
        # without noise all residuals are rounding
        if not 0 < np.mean(far) <= _FEW or bulk < _ROUNDING * np.max(size):
            continue
        share = float(np.sum(size[far] ** 2) / np.sum(size**2))
        if share > _CARRY:
            of = f" of {view.name}" if view.name else ""
            return f"{np.sum(far)} of {view.rows} points{of} carry {100 * share:.0f} % of the residuals"
    return ""


@remembered
def _cautions(scene: Scene) -> list[str]:
    """Sentences that results with the materials of a scene must carry."""
    return [sentence for material in materials_in(scene) for sentence in material.warnings()]


def _added_to_an_index(scene: Scene, ranked: RankedMinima) -> list[str]:
    """A sentence for each free n that is added to a given index, with the sum at the middle wavelength."""
    result, view = [], ranked.problem.views[0]
    for i, layer in enumerate(scene.layers):
        if isinstance(layer, Layer) and isinstance(given := layer.material, Shifted) and is_free(given.n):
            nm = np.asarray(view.scene.light.wavelength)
            middle = int(np.argmin(np.abs(nm - np.median(np.unique(nm)))))  # rows may be repeated
            name = thickness_name(scene, i).removesuffix("thickness") + "n"
            of = given.base.name if isinstance(given.base, Material) else "the model"
            n: Any = indices(view.scene, ranked.problem.seen_by(view, ranked.values)).n[i]
            total = float(n[middle])
            result.append(
                f"{name} is added to the index of {of}; the sum is {total:.4g} at {nm[middle]:.4g} nm"
            )
    return result


def unexplained_depolarisation(
    data: Sequence[Spectrum | Colours], spectra: Sequence[Any], views: Sequence[Any]
) -> list[str]:
    """A sentence for each spectrum with a depolarisation beyond its noise and the scene's uncertainty, where
    the scene has none."""
    sentences = []
    for spectrum, measured, view in zip(data, spectra, views, strict=True):
        share = spectrum.kind.share if isinstance(spectrum, Spectrum) else None
        if share is None or view.signal.depolarisation:
            continue
        values, sigma = share.measured(spectrum), share.error(spectrum)
        if sigma is None:
            sigma = np.concatenate([local_noise(values[rows]) for rows in view.sweeps])
        noise = math.sqrt(np.mean(sigma**2))
        mean_square = float(np.mean(values**2))
        by_chance = 1 + _CHANCE * math.sqrt(2 / len(spectrum))
        excess = math.sqrt(max(mean_square - by_chance * noise**2, 0.0))
        if excess > measured.scene.uncertainty.depolarisation:
            own = f"{view.name}: " if view.name else ""
            sentences.append(
                f"{own}the measured depolarisation (rms {math.sqrt(mean_square):.2g}, noise {noise:.1g}) is"
                " left out, since the scene has none: `thickness_spread`, `bandwidth`, `angle_spread` or a"
                ' back face (`back="air"`) would cause it'
            )
    return sentences
