"""Ψ and Δ, of reflected or of transmitted light.

Both are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon at small
angles, as instruments write it. In transmission it is conj(t_p / t_s), and Δ is 0 without a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np
from jaxtyping import Float

from pellicle.signals import base, sphere
from pellicle.signals.limits import check_depolarisation, check_psi_delta

DEPOLARISATION = base.Quantity("depolarisation", "depolarisation", array="depolarisation")
CHANNELS = 3
"""N, C and S."""


@dataclass(frozen=True)
class Ratios(base.Signal):
    """Ψ and Δ of one ratio of amplitudes, or of several `parts`, each a point N, C, S of a unit sphere."""

    simulated: ClassVar[str] = "Stokes"
    ordinate: ClassVar[str] = "Ψ, Δ (°)"
    degrees: ClassVar[bool] = True

    @property
    def measured(self) -> int:
        """Of N, C and S those that were measured."""
        return CHANNELS - self.folded

    def points(self, columns: Float[np.ndarray, "*lanes columns"]) -> np.ndarray:
        """Return N, C, S (or N, C) of columns: (*lanes, ratios, 3) of several ratios, (*lanes, 3) of one."""
        if self.parts:
            return columns.reshape(*columns.shape[:-1], -1, CHANNELS)
        return columns[..., : self.measured]

    @property
    def independent(self) -> int:
        return 2 * super().independent

    def coordinates(self, data: base.Arrays) -> np.ndarray:
        assert data.delta is not None
        return sphere.ncs(data.values, data.delta)[..., : self.measured].reshape(len(data), -1)

    def averaged(self, coordinates: np.ndarray) -> dict[str, np.ndarray]:
        values, delta = sphere.psi_delta(self.points(coordinates))
        return {"values": values, "delta": delta}

    def of_sums(self, sums: Sequence[Any]) -> Sequence[Any]:
        return self.waves.angles_of_sums(sums)

    def drawn(self, rows: Any) -> Any:
        return self.waves.drawn_angles(rows, self.folded)

    def rms(self, residual: np.ndarray) -> Any:
        kept = self.points(residual).reshape(*residual.shape[:-1], -1)
        return sphere.rms_of_psi(kept, self.independent * residual.shape[-2])

    def in_quantities(self, columns: np.ndarray) -> np.ndarray:
        angles = np.stack(sphere.psi_delta(self.points(columns)), axis=-1).reshape(*columns.shape[:-1], -1)
        return np.concatenate([angles, columns[..., -1:]], axis=-1) if self.depolarisation else angles

    def curves(self, data: np.ndarray, model: np.ndarray, weight: np.ndarray) -> dict[str, np.ndarray]:
        (psi, delta), (psi_model, delta_model) = (sphere.psi_delta(self.points(x)) for x in (data, model))
        along_psi = weight[:, [2 * i for i in range(len(self.parts))] if self.parts else 0]
        result = {"data": psi, "model": psi_model, "delta_data": delta, "delta_model": delta_model}
        return result | {"sigma": np.rad2deg(1 / along_psi) / 2}


@final
@dataclass(frozen=True)
class PsiDelta(Ratios):
    """Ψ and Δ, of transmitted light in `transmission`. A `folded` Δ lies within 0 to 180 degrees, its sign
    unknown; `depolarisation_known` says that the noise of a measured depolarisation is."""

    word: ClassVar[str] = "psi-delta"
    title: ClassVar[str] = "ellipsometry, psi and delta"
    noun: ClassVar[str] = "psi and delta"
    keywords: ClassVar[frozenset[str]] = frozenset(
        {"delta", "delta_sigma", "folded", "depolarisation", "depolarisation_sigma", "transmission"}
    )
    required: ClassVar[frozenset[str]] = frozenset({"delta"})
    depolarisation_known: bool = False

    @property
    def error_unit(self) -> str:
        return "degrees on the sphere of N, C, S"

    @classmethod
    def of(cls, data: Any) -> PsiDelta:
        share = data.depolarisation is not None, data.depolarisation_sigma is not None
        return PsiDelta((), share[0], data.transmission, bool(data.folded), share[1])

    @property
    def quantities(self) -> tuple[base.Quantity, ...]:
        angles = base.Quantity("psi", "Ψ", "degrees"), base.Quantity("delta", "Δ", "degrees", "delta")
        return (*angles, DEPOLARISATION) if self.depolarisation else angles

    def check(self, data: base.Arrays, place: base.Place, remedy: str) -> None:
        assert data.delta is not None
        places = place("`values`"), place("`delta`")
        check_psi_delta(data.values, data.delta, self.folded, *places, remedy)
        if data.depolarisation is not None:
            check_depolarisation(data.depolarisation, place("`depolarisation`"), remedy)

    def errors(self, values: np.ndarray, noise: float) -> dict[str, np.ndarray]:
        return dict.fromkeys(("sigma", "delta_sigma"), np.full(values.shape, float(noise)))

    def isotropic(self, rows: Sequence[Any]) -> Sequence[Any]:
        return rows[:3]

    def of_jones(self, jones: Any) -> list[Any]:
        return self.waves.stokes_of_jones(jones.pp, jones.ss)

    def of_mueller(self, matrix: Sequence[Sequence[Any]]) -> list[Any]:
        return self.waves.stokes_of_mueller(matrix)

    def synthetic(self, rows: np.ndarray, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        clean = self.waves.angles(rows)
        values = clean + noise * np.random.default_rng(seed).normal(0.0, 1.0, clean.shape)
        return np.stack([np.clip(values[:, 0], 0.0, 90.0), np.mod(values[:, 1], 360.0)], axis=1), clean

    def seen_in(self, scene: Any, depolarises: bool) -> PsiDelta:
        return self if depolarises else replace(self, depolarisation=False)

    def channels(self, data: base.Arrays, sigma: np.ndarray | None) -> base.Channels:
        """N, C, S (points, 3), or N and C alone where Δ is folded, and behind them the depolarisation.

        Where σ is known, in the frame along Ψ, along Δ and outwards; the depolarisation is before the last.
        """
        assert data.delta is not None
        values, frame = self.coordinates(data), None
        noise = np.full(len(data), sphere.ROUGH)
        if data.sigma is not None:
            of_delta = data.sigma if data.delta_sigma is None else data.delta_sigma
            noise = sphere.sphere_sigma(data.values, data.delta, data.sigma, of_delta, self.folded)
            if not self.folded:
                frame = sphere.sphere_frame(data.values, data.delta)
                values = np.einsum("pij,pj->pi", frame, values)
        if self.depolarisation and data.depolarisation is not None:
            # the last of what is measured: before the direction outwards
            place = values.shape[1] if frame is None else values.shape[1] - 1
            level = sphere.ROUGH if data.depolarisation_sigma is None else data.depolarisation_sigma
            noise = np.broadcast_to(np.reshape(noise, (len(data), -1)), values.shape)
            values = np.insert(values, place, data.depolarisation, axis=1)
            noise = np.insert(noise, place, level, axis=1)
            if frame is not None:
                frame = np.insert(np.insert(frame, place, 0.0, axis=1), 3, 0.0, axis=2)
                frame[:, place, 3] = 1.0
        return base.Channels(values, noise, frame)

    def compared(self, rows: Any, frame: Any, depolarises: bool) -> Any:
        """N, C, S as measured.

        Ψ and Δ do not depend on the degree of polarisation, so where some light is unpolarised, N, C, S are
        brought to their sphere; a rotating analyser measures N and C as they are.
        """
        if self.depolarisation:
            rows = self.waves.with_depolarisation(rows, self.measured)
        elif not self.folded and depolarises:
            rows = self.waves.on_spheres(rows)
        rows = self.waves.in_frame(frame, rows)
        return rows[..., : self.measured + self.depolarisation]

    def groups(self, count: int, framed: bool) -> tuple[base.ChannelGroup, ...]:
        every = tuple(range(count))
        if not self.depolarisation:
            return (base.ChannelGroup(every, 2),)
        position = count - 2 if framed else count - 1
        others = tuple(channel for channel in every if channel != position)
        return base.ChannelGroup(others, 2), base.ChannelGroup((position,), 1, self.depolarisation_known)

    @property
    def outwards(self) -> int:
        return 1

    def offsets(self, columns: np.ndarray, allowed: Any) -> list[base.Offset]:
        """Offsets of Ψ and Δ, and depolarisation as a rotating analyser takes it: N and C lose a share.

        An instrument that measures the depolarisation divides it out; its offset counts instead.
        """
        points = self._sphere(columns)
        n, c, s = np.moveaxis(points, -1, 0)
        share = 1 - allowed.depolarisation
        third = np.where(s < 0, -1, 1) * np.sqrt(np.maximum(1 - (share * n) ** 2 - (share * c) ** 2, 0.0))
        less = np.stack([share * n - n, share * c - c, third - s], axis=-1)
        of_psi, of_delta = sphere.angle_changes(points, allowed.psi, allowed.delta)
        result = [
            base.Offset("offset of psi", allowed.psi, "deg", self._behind(of_psi)),
            base.Offset("offset of delta", allowed.delta, "deg", self._behind(of_delta)),
        ]
        if not self.depolarisation:
            less = self._behind(less)
            return [*result, base.Offset("depolarisation", allowed.depolarisation, "", less, positive=True)]
        change = np.zeros(columns.shape)
        change[..., -1] = allowed.depolarisation
        return [*result, base.Offset("offset of the depolarisation", allowed.depolarisation, "", change)]

    def _behind(self, change: np.ndarray) -> np.ndarray:
        """A change of N, C and S as one of the measured columns; the depolarisation stays."""
        change = change[..., : self.measured]
        return np.insert(change, self.measured, 0.0, axis=-1) if self.depolarisation else change

    def _sphere(self, columns: np.ndarray) -> np.ndarray:
        """N, C, S of columns, whose last is the depolarisation if that is measured."""
        return sphere.with_third(columns[..., :-1] if self.depolarisation else columns)

    def along(self, columns: np.ndarray, change: np.ndarray, framed: bool) -> np.ndarray:
        if self.folded or framed:
            return change
        outwards = self._sphere(columns)
        change[..., :3] -= outwards * np.sum(change[..., :3] * outwards, axis=-1, keepdims=True)
        return change

    def polarised(self, columns: np.ndarray) -> np.ndarray:
        return self._sphere(columns) * np.sqrt(np.maximum(1 - columns[..., -1], 0.0))[..., None]

    def curves(self, data: np.ndarray, model: np.ndarray, weight: np.ndarray) -> dict[str, np.ndarray]:
        share = {"depolarisation_model": model[:, -1]} if self.depolarisation else {}
        return super().curves(data, model, weight) | share

    def residuals(self, data: base.Arrays, curve: Any, known: bool) -> list[base.Residuals]:
        """Residuals on the sphere, or those of Ψ and of Δ over their σ, and those of the depolarisation."""
        if data.sigma is None:
            rows = sphere.ncs(curve.data, curve.delta_data) - sphere.ncs(curve.model, curve.delta_model)
        else:
            across = data.sigma if data.delta_sigma is None else data.delta_sigma
            # at the poles, where Δ has no meaning, the error of Ψ leaves some to it
            sine, along = np.sin(2 * np.deg2rad(curve.data)), 2 * np.deg2rad(data.sigma)
            of_delta = sine / np.hypot(sine, along) * curve.delta_residual / across
            rows = np.stack([curve.residual / data.sigma, of_delta], axis=1)
        result = [base.Residuals(rows, known, 2 * len(rows))]
        if curve.depolarisation_data is not None:
            sigma = data.depolarisation_sigma
            share = curve.depolarisation_residual / (1.0 if sigma is None else sigma)
            result.append(base.Residuals(share[:, None], sigma is not None, len(share)))
        return result
