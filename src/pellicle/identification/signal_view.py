"""One spectrum and the program that simulates it for many structures at once.

A structure is a few slots, each an index at every wavelength and a thickness; empty ones are thin as nothing.
So one program for each kind of signal serves all materials and structures, and nothing compiles for a
hypothesis. Points are padded to a few lengths, so that files of any length share programs.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.dispersion.base import known_index
from pellicle.errors import UsageError
from pellicle.optics import ellipsometry, interface, plate
from pellicle.optics.coherent import few_layers
from pellicle.optics.pair import parts, to_complex, to_pair
from pellicle.optics.response import reflectance, reflectance_below, transmittance
from pellicle.scene.film import Scene

SLOTS = 4
"""Layers of a structure with roughness, or an overlayer, and a native oxide."""
FEW, MANY = 8, 256
"""Structures of one call: a value with its slopes, and a scan."""
_LENGTHS = (32, 64, 96, 128, 160, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096)
MOST_POINTS, SCANNED_POINTS = 160, 64
"""Points of one setting that are compared, and in scans: neighbours are averaged where fringes are wide."""
SIGNALS = ("R", "T", "psi-delta")


_STATIC = ("signal", "polarisations", "plate_mm")


@partial(jax.jit, static_argnames=_STATIC)
def _rows(index: Any, thickness: Any, media: Any, wavelength: Any, angle: Any, **options: Any) -> Any:
    """Rows (structures, sums, points) of intensities: R or T, or the Stokes sums.

    `index` (structures, slots, points), `thickness` (structures, slots), `media` the index of the ambient,
    the substrate and what is behind it, `angle` (structures or 1, points) in radians.
    """
    layers = [to_pair(index[:, i]) for i in range(index.shape[1])]
    phases = [2 * jnp.pi * thickness[:, i, None] / wavelength for i in range(index.shape[1])]
    return _intensities(layers, phases, media, wavelength, angle, **options)


@partial(jax.jit, static_argnames=_STATIC)
def _grid(index: Any, upper: Any, lower: Any, media: Any, wavelength: Any, angle: Any, **options: Any) -> Any:
    """Intensities (upper, lower, sums, points) of two layers `index` (2, points) in all their thicknesses."""
    phases = [2 * jnp.pi * x[..., None] / wavelength for x in (upper[:, None], lower[None])]
    layers = [to_pair(x) for x in index]
    return _intensities(layers, phases, media, wavelength, angle, **options)


def _intensities(
    layers: list[Any], phases: list[Any], media: Any, wavelength: Any, angle: Any, *, signal: str,
    polarisations: str, plate_mm: float | None,
) -> Any:  # fmt: skip
    """Intensities (..., sums, points) of layers and phases that broadcast to (..., points)."""
    ambient, substrate, behind = media[0].real, to_pair(media[1]), to_pair(media[2])
    front: Any = few_layers(ambient, layers, substrate, phases, angle, polarisations)
    if plate_mm is None and signal == "psi-delta":
        return jnp.stack(ellipsometry.stokes(*front), axis=-2)
    if plate_mm is None:
        of = reflectance if signal == "R" else transmittance
        return of(*front)[..., None, :]
    a, _ = interface.transverse(ambient, angle)
    q, q_back = interface.normal(substrate, a), interface.normal(behind, a)
    internal = plate.internal_transmittance(to_complex(q).imag, plate_mm, wavelength)
    sums, amplitudes = [], []
    for x, letter in zip(front, polarisations, strict=True):
        face: Any = substrate, q, behind, q_back, letter
        upper = plate.Face(reflectance(x), transmittance(x), reflectance_below(x))
        back = interface.reflectance(*face)
        amplitudes.append(to_complex(interface.fresnel(*face)))
        if signal == "T":
            through = interface.transmittance(*face)
            sums.append(plate.plate_transmittance(upper, back, through, internal))
        else:
            sums.append(plate.plate_reflectance(upper, back, internal))
    if signal != "psi-delta":
        return jnp.mean(jnp.stack(sums), axis=0)[..., None, :]
    cross = ellipsometry.cross_products(*front)
    returned = jnp.conj(amplitudes[1]) * amplitudes[0]
    total = plate.multiple_reflections(cross.reflected, cross.passed_twice, cross.below, returned, internal)
    return jnp.stack(ellipsometry.stokes_from_sums(sums[0], sums[1], total), axis=-2)


@dataclass(frozen=True, eq=False)
class SignalView:
    """One spectrum as it is compared, in the scene `around` of its bare substrate.

    Arrays of the light and of media are padded to a common length behind the `points` of the spectrum.
    """

    spectrum: Spectrum
    around: Scene
    tables: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def points(self) -> int:
        return len(self.spectrum)

    @property
    def signal(self) -> str:
        return self.spectrum.signal

    @cached_property
    def wavelength(self) -> np.ndarray:
        """Wavelengths (padded points,) in nm."""
        return self._padded(self.spectrum.wavelength)

    @cached_property
    def angle(self) -> np.ndarray:
        """Angles of incidence (padded points,) in degrees."""
        given = self.around.light.angle if self.spectrum.angle is None else self.spectrum.angle
        return self._padded(np.broadcast_to(np.asarray(given, float), self.points))

    @cached_property
    def oblique(self) -> bool:
        """True unless all light is at normal incidence."""
        return bool(np.any(self.angle > 0)) or self.signal == "psi-delta"

    @cached_property
    def media(self) -> np.ndarray:
        """Index (3, padded points) of the ambient, the substrate and the medium behind it."""
        below = self.around.substrate
        behind = self.around.ambient if below.back is None else below.back
        return np.stack([self.index_of(x) for x in (self.around.ambient, below.material, behind)])

    @cached_property
    def data(self) -> np.ndarray:
        """Values (points, channels) as they are compared: R or T, or N, C and S."""
        kind: Any = self.spectrum.kind
        return kind.coordinates(self.spectrum)

    @property
    def channels(self) -> int:
        return self.data.shape[1]

    @cached_property
    def span(self) -> float:
        """Range of the values: 1 of N, C and S."""
        return 1.0 if self.signal == "psi-delta" else float(np.ptp(self.data))

    @cached_property
    def position(self) -> np.ndarray:
        """Wavelengths (points,) on a scale from −1 to 1."""
        nm = self.spectrum.wavelength
        return 2 * (nm - nm[0]) / (nm[-1] - nm[0]) - 1

    def index_of(self, medium: Any) -> np.ndarray:
        """Complex index (padded points,) of a medium. It is not finite beyond its data."""
        return np.broadcast_to(as_complex(known_index(medium, self.wavelength)), self.wavelength.shape)

    def simulate(
        self,
        index: np.ndarray,
        thickness: np.ndarray,
        shift: np.ndarray | float = 0.0,
        media: np.ndarray | None = None,
        average: tuple[np.ndarray, int] | None = None,
    ) -> np.ndarray:
        """Simulate values (structures, points · channels) of structures in slots.

        `shift` is that of the angle of incidence in degrees, `media` stand for those of the view, and with
        `average` (weights, count) each `count` structures are averaged, of which light adds incoherently.
        """
        media = self.media if media is None else media
        size, rows = (MANY if index.shape[1] < SLOTS else FEW), []
        angle = np.deg2rad(self.angle + np.broadcast_to(shift, len(thickness))[:, None])
        for first in range(0, len(thickness), size):
            part = [_filled(x[first : first + size], size) for x in (index, thickness, angle)]
            light = part[2] if self.oblique else None
            with jax.enable_x64(True):
                found = _rows(part[0], part[1], media, self.wavelength, light, **self._options)
            rows.append(np.asarray(found)[: len(thickness) - first, :, : self.points])
        sums = np.concatenate(rows)
        if average is not None:
            weights, count = average
            sums = np.einsum("k,mkcp->mcp", weights, sums.reshape(-1, count, *sums.shape[1:]))
        return self._compared(np.moveaxis(sums, 1, 2)).reshape(len(sums), -1)

    def simulate_grid(self, index: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
        """Simulate values (upper · lower, points · channels) of two layers `index` (2, padded points), each
        thickness (nm) of the upper with each of the lower."""
        angle = np.deg2rad(self.angle) if self.oblique else None
        with jax.enable_x64(True):
            found = _grid(index, upper, lower, self.media, self.wavelength, angle, **self._options)
        sums = np.asarray(found)[..., : self.points].reshape(len(upper) * len(lower), -1, self.points)
        return self._compared(np.moveaxis(sums, 1, 2)).reshape(len(sums), -1)

    @cached_property
    def _options(self) -> dict[str, Any]:
        """Static arguments of the compiled programs."""
        of_light, below = self.spectrum.polarisation, self.around.substrate
        pure = self.signal != "psi-delta" and (of_light != "unpolarised" or not self.oblique)
        letters = (of_light if of_light in ("s", "p") and self.oblique else "s") if pure else "sp"
        plate_mm = None if below.back is None else below.plate_mm
        return {"signal": self.signal, "polarisations": letters, "plate_mm": plate_mm}

    def _compared(self, sums: np.ndarray) -> np.ndarray:
        if self.signal != "psi-delta":
            return np.nan_to_num(sums, nan=9.0)
        sphere = sums[..., :3] / np.maximum(sums[..., 3:], 1e-300)
        if not self.spectrum.folded:
            sphere = sphere / np.maximum(np.linalg.norm(sphere, axis=-1, keepdims=True), 1e-300)
        return np.nan_to_num(sphere[..., : self.channels], nan=9.0)

    def quantities(self, values: np.ndarray) -> np.ndarray:
        """Return simulated values as R or T, or Ψ and Δ in degrees: (points, quantities)."""
        columns = values.reshape(self.points, self.channels)
        if self.signal != "psi-delta":
            return columns
        angles: Any = self.spectrum.kind.averaged(columns)  # pyright: ignore[reportAttributeAccessIssue]
        return np.stack([angles["values"], angles["delta"]], axis=1)

    def _padded(self, values: np.ndarray) -> np.ndarray:
        length = next((x for x in _LENGTHS if x >= self.points), self.points)
        return np.concatenate([values, np.full(length - self.points, values[-1])])


def as_complex(number: Any) -> np.ndarray:
    """A number of NumPy's as a complex array."""
    re, im = parts(number)
    return np.asarray((0.0 if re is None else re) + 1j * (0.0 if im is None else im), complex)


def _filled(rows: np.ndarray, size: int) -> np.ndarray:
    """Rows up to `size`, the last repeated."""
    return rows if len(rows) == size else np.concatenate([rows, np.repeat(rows[-1:], size - len(rows), 0)])


def compared_points(spectrum: Spectrum, widest_path: float, most: int = MOST_POINTS) -> Spectrum:
    """The spectrum with neighbours averaged to at most `most` points of a setting, where fringes allow it.

    `widest_path` (nm) is the optical path of the closest fringes; each keeps 8 points.
    """
    spectrum = replace(spectrum, depolarisation=None, depolarisation_sigma=None)  # of which no use is made
    kind: Any = spectrum.kind
    rows = []
    for own in settings_of(spectrum):
        nm = spectrum.wavelength[own]
        fringes = widest_path * (1 / nm[0] - 1 / nm[-1])
        count = max(most, min(len(nm), int(8 * fringes)))
        rows.append((own, -(-len(nm) // count)))
    if all(step == 1 for _, step in rows):
        return spectrum
    coordinates = kind.coordinates(spectrum)

    def mean(values: np.ndarray) -> np.ndarray:
        blocks = [values[own][: len(own) // step * step] for own, step in rows]
        steps = [step for _, step in rows]
        return np.concatenate(
            [b.reshape(-1, s, *b.shape[1:]).mean(1) for b, s in zip(blocks, steps, strict=True)]
        )

    angle = None if spectrum.angle is None else mean(spectrum.angle)
    fresh = dict.fromkeys(("sigma", "delta_sigma", "lines"))
    averaged = kind.averaged(mean(coordinates))
    return replace(spectrum, **{**fresh, "wavelength": mean(spectrum.wavelength), "angle": angle, **averaged})


def settings_of(spectrum: Spectrum) -> list[np.ndarray]:
    """Positions of the points of each angle of incidence."""
    angle = np.zeros(len(spectrum)) if spectrum.angle is None else spectrum.angle
    return [np.flatnonzero(angle == x) for x in np.unique(angle)]


def check_signal(spectrum: Spectrum) -> None:
    """Raise UsageError for a signal that is not identified."""
    if spectrum.signal not in SIGNALS or spectrum.transmission or not spectrum.calibrated:
        name = "uncalibrated values" if not spectrum.calibrated else spectrum.kind.noun
        raise UsageError(
            f"{spectrum.path or 'the data'}: {name} cannot be identified: give calibrated reflectance or"
            " transmittance, or psi and delta of reflected light"
        )
