"""Recognition of a folded Δ, whose sign was not measured: it turns back at 0 or 180 with a kink.

S = sin 2Ψ sin Δ is a smooth function of the wavelength. Where it changes its sign, a folded Δ has |S|, which
is no polynomial nearby; with the sign put back it is one. A smooth S that only touches zero is one as it
stands.
"""

import numpy as np
from jaxtyping import Float

from pellicle.signals.limits import FOLDED_DELTA, ROUNDING

_HALF_WIDTHS = (4, 5, 6, 8, 11, 15, 20, 28, 40)
"""Points on each side of a kink to which cubic polynomials are fitted."""
_BETTER = 16.0
"""Ratio of the variances of residuals, as measured and with the sign put back, from which there is a kink.

Of simulated films (10 nm to 5 µm, on Si, glass and metals, steps of 1 to 10 nm, noise up to 0.3° of Ψ and
0.6° of Δ) none of 1923 that were not folded was taken to be, and of smooth Δ that come close to 180 one of
26 000 (in steps of a twelfth of its period). Half of the folded films were missed: most of those of several
µm or in steps of 10 nm, and on glass, where S is small. `fitting.film.other_readings` is for these."""
_RISE = 0.03
"""Least |S| on both sides of a kink."""
_SHARE = 0.7
"""Share of the distance to the nearest maxima of |S| within which the polynomials are fitted."""
_FALLS, _CLEAR = 0.1, 5.0
"""Fall behind a maximum, relative to it and in standard deviations of the noise."""
_ROUNDED = 1e-5
"""Standard deviation of rounded numbers."""


def can_be_folded(delta: Float[np.ndarray, " points"]) -> bool:
    """True where all Δ lie within 0 to 180 degrees."""
    low, high = FOLDED_DELTA
    return bool(np.all((delta >= low - ROUNDING) & (delta <= high + ROUNDING)))


def folding_at(
    wavelength: Float[np.ndarray, " points"],
    psi: Float[np.ndarray, " points"],
    delta: Float[np.ndarray, " points"],
    group: Float[np.ndarray, " points"],
) -> float | None:
    """The wavelength at which Δ is folded, None where nothing shows it.

    Ψ and Δ are in degrees; points of one `group` (an angle of incidence and an azimuth) form one curve.
    """
    if not can_be_folded(delta):
        return None
    places: list[tuple[float, float]] = []
    for value in np.unique(group):
        rows = np.flatnonzero(group == value)
        rows = rows[np.argsort(wavelength[rows], kind="stable")]
        if np.all(np.diff(wavelength[rows]) > 0):
            places += kinks(wavelength[rows], psi[rows], delta[rows])
    return max(places)[1] if places else None


def folding_note(wavelength: float) -> str:
    """A sentence on a Δ that is taken as folded."""
    return (
        f"delta lies within 0 to 180 and turns back there with a kink, most clearly at {wavelength:.4g} nm:"
        " taken as folded, so that cos(delta) is fitted; if its sign was measured, give `folded=False`"
    )


def kinks(
    wavelength: Float[np.ndarray, " points"],
    psi: Float[np.ndarray, " points"],
    delta: Float[np.ndarray, " points"],
) -> list[tuple[float, float]]:
    """Kinks of S: how much better it is with its sign put back, and the wavelength."""
    s = np.abs(np.sin(2 * np.deg2rad(psi)) * np.sin(np.deg2rad(delta)))
    if s.size < 4:
        return []
    rough = s[3:] - 3 * s[2:-1] + 3 * s[1:-2] - s[:-3]
    noise = 1.4826 * float(np.median(np.abs(rough))) / np.sqrt(20) + _ROUNDED
    lowest = np.flatnonzero((s[1:-1] <= s[:-2]) & (s[1:-1] <= s[2:])) + 1
    result = []
    for split in np.union1d(lowest, lowest + 1).tolist():
        kink = 0.5 * (wavelength[split - 1] + wavelength[split])
        widest = _SHARE * min(_rising(s[split - 1 :: -1], noise), _rising(s[split:], noise))
        for half in _HALF_WIDTHS:
            if half > widest:
                break
            near, position = (x[split - half : split + half] for x in (s, wavelength - kink))
            rise = min(near[:half].max(), near[half:].max())
            basis = np.linalg.qr(np.vander(position / np.ptp(position), 4))[0]
            columns = np.stack([near, np.where(np.arange(2 * half) < half, -near, near)], axis=1)
            rest = columns - basis @ (basis.T @ columns)
            as_measured, restored = np.sum(rest**2, axis=0) / (2 * half - 4)
            if max(as_measured, restored) > _BETTER * noise**2:
                # the narrowest window that tells them apart decides: a wide one has other bends
                ratio = float(as_measured / max(restored, noise**2))
                if ratio > _BETTER and rise > _RISE:
                    result.append((ratio, float(kink)))
                break
    return result


def _rising(s: Float[np.ndarray, " points"], noise: float) -> int:
    """Number of points from the first to the first maximum that is none by noise."""
    highest = np.maximum.accumulate(s)
    fallen = np.flatnonzero(s < highest - np.maximum(_FALLS * highest, _CLEAR * noise))
    return int(np.argmax(s[: fallen[0]] if fallen.size else s)) + 1
