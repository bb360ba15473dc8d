"""Structure in residuals: the wavelengths at which the model misses something."""

import math
from typing import NamedTuple

import numpy as np

from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.noise import local_noise, uneven_noise
from pellicle.fitting.reweighting import ViewFit

_NARROWEST = 5
"""Points in the narrowest window whose mean is tested."""
_CHANCE = 0.01
"""Probability that pure noise is reported as structure, in any of the curves of a view."""
_CLIP = 4.0
"""Standard deviations at which residuals are clipped: a lone outlier is no structure."""
_MOST, _SHOWN = 12, 2
_EVERYWHERE = 0.6
"""Share of a spectrum that is called most of it."""


class Window(NamedTuple):
    """Points `first` to `last` (included) whose mean residual is `score` standard deviations off zero."""

    first: int
    last: int
    score: float


def windows(z: np.ndarray, curves: int = 1) -> list[Window]:
    """Windows of residuals `z`, in standard deviations of white noise, whose mean noise does not explain.

    Means over windows of all positions, of widths that grow by half, are compared with the largest mean
    that noise of as many points shows by chance in one of so many `curves`. The strongest is taken first;
    neighbours merge.
    """
    z, size, result = np.clip(z, -_CLIP, _CLIP), len(z), []
    bar = math.sqrt(2 * math.log(max(size, 2) * curves / _CHANCE))
    widths = []
    while (width := _NARROWEST * 1.5 ** len(widths)) <= size / 2:
        widths.append(int(width))
    for _ in range(_MOST if widths else 0):
        strongest = []
        for width in widths:
            sums = np.abs(np.convolve(z, np.ones(width), mode="valid")) / math.sqrt(width)
            at = int(np.argmax(sums))
            strongest.append(Window(at, at + width - 1, float(sums[at])))
        best = max(strongest, key=lambda w: w.score)
        if best.score < bar:
            break
        result.append(best)
        z[best.first : best.last + 1] = 0.0
    merged: list[Window] = []
    for window in sorted(result):
        last = merged[-1] if merged else None
        # where their gap is narrower than the narrower one: a wave has two signs
        if last and window.first - last.last <= min(last.last - last.first, window.last - window.first) + 1:
            merged[-1] = Window(last.first, max(last.last, window.last), max(last.score, window.score))
        else:
            merged.append(window)
    return sorted(merged, key=lambda w: -w.score)


class Missed(NamedTuple):
    """Wavelengths at which the model misses something, the strongest first, and the mean size (None for Ψ and
    Δ)."""

    spans: tuple[str, ...]
    size: float | None
    everywhere: bool

    @property
    def place(self) -> str:
        """`at 480-520 nm`, empty where it is most of the spectrum."""
        return "" if self.everywhere else f"at {' and '.join(self.spans[:_SHOWN])}"

    @property
    def words(self) -> str:
        """`at 480-520 nm (by 0.011 on average)`."""
        by = "" if self.size is None else f" (by {self.size:.2g} on average)"
        return f"{self.place or 'over most of the spectrum'}{by}"


def missed(view: SpectrumView | ColoursView, fit: ViewFit) -> Missed | None:
    """Structure in the residuals of the best fit, None where they may be noise, and for colours."""
    if isinstance(view, ColoursView):
        return None
    nm, residuals = np.asarray(view.scene.light.wavelength)[: view.rows], _residuals(view, fit)
    weight = np.asarray(view.data.weight)[: view.points].reshape(view.rows, view.channels)
    known = view.noise.given or view.noise.drifting
    stretches, covered = [], 0
    parts = [part for part in view.sweeps if len(part) >= 2 * _NARROWEST]
    for part in parts:
        for column, inverse in zip(residuals[part].T, weight[part].T, strict=False):
            # a detector may have more noise at one end: that is no structure
            ratio = uneven_noise(column, [np.arange(len(column))])
            noise = ratio * max(np.median(local_noise(column / ratio)), 1e-300)
            scale = np.minimum(inverse, 1 / noise) if known else 1 / noise
            for w in windows(column * scale, len(parts) * view.measured_channels):
                inside = nm[part][w.first : w.last + 1]
                size = float(np.mean(np.abs(column[w.first : w.last + 1])))
                covered += len(inside)
                stretches.append((w.score, f"{inside.min():.0f}-{inside.max():.0f} nm", size))
    if not stretches:
        return None
    stretches.sort(reverse=True)
    spans = tuple(dict.fromkeys(span for _, span, _ in stretches))
    return Missed(
        spans, None if view.signal.ellipsometric else stretches[0][2], covered > _EVERYWHERE * residuals.size
    )


def uneven(view: SpectrumView | ColoursView, fit: ViewFit) -> str:
    """Words on wavelengths at which a spectrum of one column is much noisier than σ and other points say."""
    if isinstance(view, ColoursView) or view.measured_channels > 1:
        return ""
    nm, [column] = np.asarray(view.scene.light.wavelength)[: view.rows], _residuals(view, fit).T
    sigma = 1 / np.asarray(view.data.weight)[: view.points] if view.noise.known else 1.0
    far = uneven_noise(column / sigma, view.sweeps) > 1
    if not np.any(far):
        return ""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], far, [False]])))
    regions = sorted(edges.reshape(-1, 2).tolist(), key=lambda ends: ends[0] - ends[1])[:_SHOWN]
    at = " and ".join(f"{nm[first:last].min():.0f}-{nm[first:last].max():.0f} nm" for first, last in regions)
    high, low = (float(np.std(column[which])) for which in (far, ~far))
    does = "its σ is too small there" if view.noise.given else "these points count for less"
    return f"noise differs along the spectrum: {high:.2g} at {at}, {low:.2g} elsewhere; {does}"


def _residuals(view: SpectrumView, fit: ViewFit) -> np.ndarray:
    """Residuals (rows, measured channels) of a spectrum at the best fit, in the unit of the data."""
    residuals = (np.asarray(view.data.values) - np.asarray(fit.at.model))[: view.points]
    return residuals.reshape(view.rows, view.channels)[:, : view.measured_channels]
