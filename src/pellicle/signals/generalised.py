"""Generalised Ψ and Δ: three ratios of the elements of a Jones matrix, of samples that turn p into s.

With r_ab the amplitude of the reflected b for incident a, as in files of J. A. Woollam:

- AnE: r_pp/r_ss,
- Aps: r_ps/r_pp, s over p of the light that is reflected where p is incident,
- Asp: r_sp/r_ss, p over s of the light that is reflected where s is incident.

`pellicle.jones` has the indices in the other order: its r_sp, row s and column p, is r_ps here. Each ratio
is tan Ψ exp(iΔ), with the sign of Δ of `pellicle.ellipsometry`. Of a sample that does not mix s and p, Aps
and Asp are 0.

In a fit each ratio is a point N, C, S on a sphere of its own. The channels are directions on it: two of each
ratio, and behind these the direction outwards of each, in which nothing is measured.

Source: M. Schubert, Phys. Rev. B 53, 4265 (1996), for the ratios and the order of the indices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from jaxtyping import Float

from pellicle.signals import base
from pellicle.signals.limits import check_psi_delta
from pellicle.signals.psi_delta import CHANNELS, Ratios
from pellicle.signals.sphere import ROUGH, angle_changes, ncs, scattered, sphere_frame, sphere_sigma

RATIOS = ("ane", "aps", "asp")
FORMULAS = {"ane": "r_pp/r_ss", "aps": "r_ps/r_pp", "asp": "r_sp/r_ss"}
"""Ratios in Woollam's indices, the first of them incident."""
NAMES = {"ane": "AnE", "aps": "Aps", "asp": "Asp"}
"""Ratios as Woollam's programs write them."""
_IN_FIGURES = {"ane": "$r_{pp}/r_{ss}$", "aps": "$r_{ps}/r_{pp}$", "asp": "$r_{sp}/r_{ss}$"}
_ALIKE = 1.5
"""Largest ratio of errors that are alike."""
_POLE = 4.0
"""Standard deviations of Ψ from 0 or 90 degrees within which Δ is mostly noise."""


@final
@dataclass(frozen=True)
class Generalised(Ratios):
    """Ψ and Δ of the ratios `parts`, all by default. Raises UsageError for unknown and repeated ones."""

    word: ClassVar[str] = "generalised-psi-delta"
    title: ClassVar[str] = "generalised ellipsometry, psi and delta of ratios"
    noun: ClassVar[str] = "generalised psi and delta"
    keywords: ClassVar[frozenset[str]] = frozenset({"ratios", "delta", "delta_sigma"})
    required: ClassVar[frozenset[str]] = frozenset({"ratios", "delta"})
    explored: ClassVar[bool] = False
    named: ClassVar[str] = "ratios"
    every: ClassVar[tuple[str, ...]] = RATIOS
    expected: ClassVar[str] = "of generalised psi and delta must be among ane, aps, asp"
    parts: tuple[str, ...] = RATIOS

    @property
    def error_unit(self) -> str:
        return "degrees on the spheres of N, C, S"

    @property
    def quantities(self) -> tuple[base.Quantity, ...]:
        angles = (("psi", "Ψ", "values", ""), ("delta", "Δ", "delta", "½ sin 2Ψ "))
        result = []
        for i, name in enumerate(self.parts):
            for row, (angle, sign, array, weight) in enumerate(angles):
                shown = f"{sign} {NAMES[name]}"
                cell = base.Cell(row, i, shown, f"{weight}{shown}", 0.5)
                result.append(base.Quantity(f"{angle}_{name}", f"{sign} {name}", "degrees", array, i, cell))
        return tuple(result)

    @property
    def grid(self) -> tuple[tuple[str, ...], ...]:
        """Ψ of each ratio above its Δ."""
        return (
            tuple(f"Ψ of {NAMES[name]} = {_IN_FIGURES[name]} (degrees)" for name in self.parts),
            tuple(f"Δ of {NAMES[name]} (degrees)" for name in self.parts),
        )

    def check(self, data: base.Arrays, place: base.Place, remedy: str) -> None:
        assert data.delta is not None
        for name, psi, delta in zip(self.parts, data.values.T, data.delta.T, strict=True):
            places = place(f"`{name} values`"), place(f"`{name} delta`")
            check_psi_delta(psi, delta, False, *places, remedy)

    def errors(self, values: np.ndarray, noise: float) -> dict[str, np.ndarray]:
        """One error along Ψ and across it."""
        sigma = np.full(values.shape, float(noise))
        return {"sigma": sigma, "delta_sigma": delta_sigma(values, sigma)}

    def isotropic(self, rows: Sequence[Any]) -> Sequence[Any]:
        if len(rows) > CHANNELS:
            return self.of_sums(self.of_mueller(self.waves.isotropic_matrix(*rows)))
        return self.waves.without_mixing(rows)

    def of_jones(self, jones: Any) -> list[Any]:
        # Woollam's r_ps is the element in row s and column p
        pairs = (jones.pp, jones.ss), (jones.sp, jones.pp), (jones.ps, jones.ss)
        return [part for pair in pairs for part in self.waves.stokes_of_jones(*pair)]

    def of_mueller(self, matrix: Sequence[Sequence[Any]]) -> list[Any]:
        return self.waves.ratio_sums_of_mueller(matrix)

    def synthetic(self, rows: np.ndarray, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        sphere = rows.reshape(len(rows), -1, CHANNELS)
        noisy, clean = (
            self.waves.angles(own)[:, self.positions].reshape(len(rows), -1)
            for own in (scattered(sphere, noise, seed), sphere)
        )
        return noisy, clean

    def channels(self, data: base.Arrays, sigma: np.ndarray | None) -> base.Channels:
        frames, spread = self._directions(data)
        outwards = np.broadcast_to([0.0, 0.0, 1.0], spread.shape)
        return base.Channels(_in_directions(outwards), _in_directions(spread), block_frame(frames))

    def _directions(self, data: base.Arrays) -> tuple[np.ndarray, np.ndarray]:
        """Directions of each ratio, (points, ratios, 3, 3), and σ of N, C, S in them, (points, ratios, 3)."""
        assert data.delta is not None
        sigma = np.full((*data.values.shape, 3), ROUGH)
        if data.sigma is not None and data.delta_sigma is not None:
            sigma = sphere_sigma(data.values, data.delta, data.sigma, data.delta_sigma)
        return upright(sphere_frame(data.values, data.delta), sigma, data.values, data.delta)

    def compared(self, rows: Any, frame: Any, depolarises: bool) -> Any:
        """N, C, S of the measured ratios, each brought to its sphere, in the frame of the data."""
        positions = [CHANNELS * place + i for place in self.positions for i in range(CHANNELS)]
        rows = self.waves.columns(rows, positions)
        rows = self.waves.on_spheres(rows) if depolarises else rows
        return self.waves.in_frame(frame, rows)

    def groups(self, count: int, framed: bool) -> tuple[base.ChannelGroup, ...]:
        ratios = len(self.parts)
        return tuple(base.ChannelGroup((2 * i, 2 * i + 1, 2 * ratios + i), 2) for i in range(ratios))

    @property
    def outwards(self) -> int:
        return len(self.parts)

    def offsets(self, columns: np.ndarray, allowed: Any) -> list[base.Offset]:
        """Offsets of Ψ and of Δ of each ratio."""
        spheres = columns.reshape(*columns.shape[:-1], -1, CHANNELS)
        both = angle_changes(spheres, allowed.psi, allowed.delta)
        result = []
        for i, name in enumerate(self.parts):
            for angle, size, every in zip(("psi", "delta"), (allowed.psi, allowed.delta), both, strict=True):
                change = np.zeros(spheres.shape)
                change[..., i, :] = every[..., i, :]
                result.append(
                    base.Offset(f"offset of {angle} of {name}", size, "deg", change.reshape(columns.shape))
                )
        return result

    def residuals(self, data: base.Arrays, curve: Any, known: bool) -> list[base.Residuals]:
        frames, spread = self._directions(data)
        apart = ncs(curve.data, curve.delta_data) - ncs(curve.model, curve.delta_model)
        rows = np.einsum("prij,prj->pri", frames, apart)
        rows = (rows if data.sigma is None else rows / spread)[..., :2]
        return [base.Residuals(rows[:, i], known, 2 * len(rows)) for i in range(len(self.parts))]


def delta_sigma(
    psi: Float[np.ndarray, "*points"], psi_sigma: Float[np.ndarray, "*points"] | float
) -> Float[np.ndarray, "*points"]:
    """Return the σ of Δ where a ratio has the same error along Ψ and across it; all in degrees.

    On the sphere of N, C, S a σ of Ψ is 2σ in any direction, and one of Δ moves a point by sin 2Ψ σ_Δ. Where
    the ratio is 0 or infinite Δ has no meaning, and its σ ends at 1 radian.
    """
    along = 2 * np.deg2rad(psi_sigma)
    return np.rad2deg(along / np.hypot(np.sin(2 * np.deg2rad(psi)), along))


def upright(
    frames: Float[np.ndarray, "points ratios 3 3"],
    sigma: Float[np.ndarray, "points ratios 3"],
    psi: Float[np.ndarray, "points ratios"],
    delta: Float[np.ndarray, "points ratios"],
) -> tuple[Float[np.ndarray, "points ratios 3 3"], Float[np.ndarray, "points ratios 3"]]:
    """Return frames along Ψ and Δ, and σ in them, turned so that they do not turn with Δ.

    Where a ratio is nearly 0 its Δ is noise, and the direction along Ψ is that of the noise itself: residuals
    in it are all of one sign. The directions of C and S have no such sense. Frames are turned where the
    errors of both directions are alike, or where Ψ is within its noise of 0 or 90 degrees; they share one σ
    then.
    """
    along, across = sigma[..., 0], sigma[..., 1]
    pole = np.sin(2 * np.deg2rad(psi)) < _POLE * along
    alike = pole | (np.abs(np.log(across / along)) < np.log(_ALIKE))
    turn = np.deg2rad(np.where(alike, np.where(psi < 45, delta, -delta), 0.0))[..., None]
    one, other = frames[..., 0, :], frames[..., 1, :]
    turned = np.cos(turn) * one - np.sin(turn) * other, np.sin(turn) * one + np.cos(turn) * other
    shared = np.where(alike[..., None], np.sqrt((along**2 + across**2) / 2)[..., None], sigma)
    return np.stack([*turned, frames[..., 2, :]], axis=-2), shared


def _in_directions(ratios: Float[np.ndarray, "points ratios 3"]) -> Float[np.ndarray, "points channels"]:
    """Return the channels, of numbers in two directions and outwards of each ratio."""
    return np.concatenate([ratios[..., :2].reshape(len(ratios), -1), ratios[..., 2]], axis=1)


def block_frame(
    frames: Float[np.ndarray, "points ratios 3 3"],
) -> Float[np.ndarray, "points channels channels"]:
    """Return the frame of all ratios, of the frame of each."""
    points, count = frames.shape[:2]
    size = CHANNELS * count
    whole = np.zeros((points, size, size))
    for i in range(count):
        rows = [2 * i, 2 * i + 1, 2 * count + i]
        whole[:, rows, CHANNELS * i : CHANNELS * (i + 1)] = frames[:, i]
    return whole
