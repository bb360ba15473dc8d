"""Targets of a fit of colours: linear values, σ and the scene that is to explain them."""

from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.colour.encoding import Encoding, camera_encoding, encoding
from pellicle.data.colours import Colours
from pellicle.effects.differences import largest_index
from pellicle.effects.film_plan import plan
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.colour_view import ColourData, ColoursView, camera_response
from pellicle.fitting.film.parameters import anonymous
from pellicle.fitting.problem import Noise
from pellicle.forward_model.film_signal import tabulated
from pellicle.scene.film import Light, Scene, coherent_layers, with_wavelength
from pellicle.scene.free import is_free
from pellicle.scene.instrument import Drift

_APART = 8.0
"""Standard deviations by which no two measurements of one colour differ."""


class MeasuredColours(NamedTuple):
    """Colours of one film, and the scene that is to explain them, with the wavelengths of the sensor."""

    scene: Scene
    colours: Colours
    name: str = ""  # that of one among several

    noise = Noise(given=True)

    @property
    def wavelength(self) -> np.ndarray:
        """Wavelengths of the sensor (nm)."""
        return self.colours.sensor[0]


def arrays(target: tuple[Any, ...]) -> tuple[Any, ...]:
    """A target as a pytree of all that it depends on: of colours their arrays and words."""
    if not isinstance(target, MeasuredColours):
        return target
    own = target.colours
    about = own.values, own.noise, own.sensor, own.camera, own.gamma
    return target.scene, *about, own.space, own.white_balance, target.name


def measured_colours(data: Colours, scene: Scene, name: str = "") -> MeasuredColours:
    """Colours with the scene in their light. Raises UsageError as `fit` does."""
    angle: Any = scene.light.angle
    own, count, place = data.angle, len(data.sensor[0]), f"{data.source}: " if data.source else ""
    if own is not None and is_free(angle):
        if np.ptp(own) > 0:
            raise UsageError(
                f"{place}has several angles of incidence, and one free angle cannot stand for them"
            )
    elif own is not None:
        if np.ndim(angle) == 0 and angle and not np.isclose(own, angle, atol=1e-3).any():
            raise UsageError(
                f"{place}has its own angles of incidence, which contradict `angle={float(angle):g}`;"
                " leave that out"
            )
        angle = float(own[0]) if np.ptp(own) == 0 else np.repeat(own, count)
    apart = np.ptp(data.values, axis=0) / np.median(data.noise, axis=0)
    if (own is None or np.ptp(own) == 0) and np.max(apart) > _APART:
        ignored = next((note for note in data.notes if note.startswith("ignored: ")), "")
        unknown = f" ({ignored})" if ignored else ""
        raise DataError(
            f"{place}{len(data)} colours of one film at one angle of incidence differ by up to"
            f" {np.max(apart):.2g} standard deviations{unknown}: give each its angle, in a column angle_deg,"
            " or tell the films apart by a column name"
        )
    instrument = scene.instrument
    if isinstance(instrument.scale, Drift) and instrument.scale.degree:
        raise UsageError(
            f'{data.source}: a colour has one scale, its exposure: give `scale="free"` or a number'
        )
    if isinstance(instrument.offset, Drift) or instrument.offset != 0.0:
        raise UsageError(f"{place}a colour has no offset: leave it out")
    if np.ndim(scene.light.azimuth):
        raise UsageError(f"{place}colours are of one azimuth of the sample: give the scene one")
    stated = data.polarisation != "unpolarised"
    polarisation = data.polarisation if stated else scene.light.polarisation
    wavelength = np.tile(data.sensor[0], len(data))
    light = Light(wavelength, angle, data.signal, polarisation, scene.light.azimuth)
    return MeasuredColours(eqx.tree_at(lambda s: s.light, scene, light), data, name)


def encoding_of(data: Colours) -> Encoding:
    """The encoding of the space of the colours: its linear channels, of the sensor's colours."""
    white = data.sensor[1].sum(axis=0)
    if data.space != "rgb":
        return encoding(data.space, white)
    own = np.diag(1 / white) if data.camera is None else np.asarray(data.camera.matrix)
    return camera_encoding(data.gamma)._replace(linear=own)


def colours_view(
    measured: MeasuredColours, takes: tuple[int, ...], tolerance: float, kept: tuple[str, ...]
) -> ColoursView:
    """The view of measured colours. `kept` names effects that a tolerance does not remove.

    Errors are taken to first order from the space of the colours to linear channels.
    """
    scene, colours = measured.scene, measured.colours
    chosen = plan(scene, tolerance, kept)
    code = encoding_of(colours)
    linear = code.decoded(colours.values)
    response, modes = camera_response(colours, code.linear, scene.instrument.scale)
    values, zero = colours.values, np.zeros(colours.values.shape)
    # exact 0 and 1 are where a camera clips
    limits = np.where(values >= 1, 1.0, np.where(values <= 0, -1.0, zero)) if code.clips else zero
    if colours.space == "rgb":
        limits = np.where((values == 0) | (values == 1), limits, 0.0)
    data = ColourData(
        values=linear,
        frame=code.rise(linear) / colours.noise[:, :, None],
        weight=np.ones(linear.shape),
        limits=limits,
        sensor=colours.sensor[1],
        response=response,
        independent_fraction=np.float64(1.0),
    )
    steepest = max(
        (largest_index(x.material, measured.wavelength) for x in coherent_layers(scene)), default=1.0
    )
    sampled = tabulated(
        with_wavelength(scene, np.asarray(scene.light.wavelength)),
        chosen.on("coherence") or scene.instrument.wavelength_shift is not None,
    )
    return ColoursView(measured.name, chosen, anonymous(sampled), data, takes, code, tuple(modes), steepest)
