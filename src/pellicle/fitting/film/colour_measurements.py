"""Colours in a fit: their target and view, their part and curve, evidence of a discrepancy, probabilities."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.colour.spaces import camera_encoding, delta_e76, encoding, lab
from pellicle.data.colours import Colours
from pellicle.effects.differences import largest_index
from pellicle.effects.film_plan import plan
from pellicle.errors import DataError, UsageError
from pellicle.fitting.curves import ColourCurve
from pellicle.fitting.film.camera_errors import channel_errors
from pellicle.fitting.film.colour_view import ColourData, ColoursView, Local, camera_response
from pellicle.fitting.film.extended_scene import Number, extended
from pellicle.fitting.film.parameters import anonymous
from pellicle.fitting.film.systematic_effects import named_for, simulated_effects
from pellicle.fitting.linear_system import Effect, Evidence
from pellicle.fitting.misfit import Accuracy
from pellicle.fitting.problem import Noise
from pellicle.fitting.reported_layer import index_of_layer
from pellicle.fitting.result import Part
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
    c = target.colours
    numbers = c.values, c.noise, c.sensor, c.camera, c.gamma
    return target.scene, *numbers, c.space, c.white_balance, target.name


def measured_colours(data: Colours, scene: Scene, name: str = "") -> MeasuredColours:
    """Colours with the scene in their light. Raises UsageError as `fit` does."""
    angle: Any = scene.light.angle
    stated, place = data.angle, f"{data.source}: " if data.source else ""
    several = stated is not None and np.ptp(stated) > 0
    if several and is_free(angle):
        raise UsageError(f"{place}has several angles of incidence, and one free angle cannot stand for them")
    if stated is not None and not is_free(angle):
        if np.ndim(angle) == 0 and angle and not np.isclose(stated, angle, atol=1e-3).any():
            raise UsageError(
                f"{place}has its own angles of incidence, which contradict `angle={float(angle):g}`;"
                " leave that out"
            )
        angle = np.repeat(stated, len(data.sensor[0])) if several else float(stated[0])
    apart = np.ptp(data.values, axis=0) / np.median(data.noise, axis=0)
    if not several and np.max(apart) > _APART:
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
    unpolarised = data.polarisation == "unpolarised"
    polarisation = scene.light.polarisation if unpolarised else data.polarisation
    wavelength = np.tile(data.sensor[0], len(data))
    light = Light(wavelength, angle, data.signal, polarisation, scene.light.azimuth)
    return MeasuredColours(eqx.tree_at(lambda s: s.light, scene, light), data, name)


def colours_view(
    measured: MeasuredColours, takes: tuple[int, ...], tolerance: float, kept: tuple[str, ...]
) -> ColoursView:
    """The view of measured colours. `kept` names effects that a tolerance does not remove.

    Errors are taken to first order from the space of the colours to linear channels.
    """
    scene, colours = measured.scene, measured.colours
    chosen, white = plan(scene, tolerance, kept), colours.sensor[1].sum(axis=0)
    if colours.space == "rgb":
        camera = np.diag(1 / white) if colours.camera is None else np.asarray(colours.camera.matrix)
        code = camera_encoding(colours.gamma)._replace(linear=camera)
    else:
        code = encoding(colours.space, white)
    linear = code.decoded(colours.values)
    response, modes = camera_response(colours, code.linear, scene.instrument.scale)
    # exact 1 is where a camera clips: the film may be brighter
    highest = np.where(code.clips & (colours.values == 1), 1.0, np.inf)
    data = ColourData(
        values=linear,
        frame=code.rise(linear) / colours.noise[:, :, None],
        weight=np.ones(linear.shape),
        clipped=(np.float64(0.0 if code.clips else -np.inf), highest),
        sensor=colours.sensor[1],
        response=response,
    )
    densest = max(
        (largest_index(x.material, measured.wavelength) for x in coherent_layers(scene)), default=1.0
    )
    shifts = chosen.on("coherence") or scene.instrument.wavelength_shift is not None
    sampled = tabulated(with_wavelength(scene, np.asarray(scene.light.wavelength)), shifts)
    return ColoursView(measured.name, chosen, anonymous(sampled), data, takes, code, tuple(modes), densest)


def colour_curve(colours: Colours, view: ColoursView, at: Local, covariance: np.ndarray) -> ColourCurve:
    """Data and model in the space of the data, and the layer's index at the wavelengths of the sensor."""
    nm, sensor = colours.sensor
    difference = None  # where the channels are those of a camera
    if colours.space != "rgb" or colours.camera is not None:
        to_xyz, white = np.linalg.inv(view.encoding.linear), sensor.sum(axis=0)
        both = (np.asarray(lab(np.asarray(x) @ to_xyz.T, white)) for x in (view.data.values, at.model))
        difference = np.asarray(delta_e76(*both))
    return ColourCurve(
        data=colours.values,
        sigma=colours.noise,
        model=view.encoded(at.model),
        difference=difference,
        **index_of_layer(view.scene, at, covariance, nm),
    )


_UNLIKE, _CONTRADICTED = 10.0, 5.0
"""ΔE*ab from the right colour, and reduced χ² by a given σ, that no measured colour of a film has."""
LARGEST = 0.03
"""Difference of a channel, in units of its range, that no calibrated camera makes: a ΔE*ab of about 3."""


def colours_evidence(
    view: ColoursView,
    values: np.ndarray,
    at: Local,
    measured: MeasuredColours,
    block: np.ndarray,
    example: np.ndarray,
) -> Evidence:
    """Evidence of colours at `values` (the parameters of the view,), in units of their σ.

    `block` are their rows of the scaled Jacobian, by the σ of their weights; effects are simulated as at the
    values of an `example`.
    """
    weight = np.asarray(view.data.weight)
    columns = block.reshape(view.rows, 3, -1) / weight[:, :, None]
    residual, one = view.residuals(at) / weight, np.ones(weight.shape)
    response = view.response(at)
    simulated = [
        row.effect(view.weighted(at, (weights @ change).reshape(-1, 3) @ response.T) / weight)
        for row, weights, change in simulated_effects(view, values, measured.scene, example)
    ]
    every = [*camera_errors(view, at, measured), *lamp_errors(view, values, at, measured.scene, example)]
    effects = [
        Effect(name, size, "", view.weighted(at, size * change) / weight, shared=False)
        for name, size, change in every
        if size
    ]
    counted = weight * np.sqrt(view.independent_fraction)
    effects = named_for([*simulated, *effects], view.name)
    return Evidence(residual, columns, one, 1.0, counted, effects, view.correlation_length)


def camera_errors(
    view: ColoursView, at: Local, measured: MeasuredColours
) -> Iterator[tuple[str, float, np.ndarray]]:
    """Errors of the recorded linear channels (colours, 3): name, standard uncertainty, change by one unit."""
    colours, allowed = measured.colours, measured.scene.uncertainty
    errors = channel_errors(
        *(np.asarray(at.model), allowed, colours.space),
        balance=colours.balance,
        coded=colours.space == "srgb" or colours.gamma != 1,
        scaled=not isinstance(measured.scene.instrument.scale, Drift),
        mixed=colours.space == "srgb" or not colours.calibrated,
    )
    balanced = any(name.startswith("white_balance") for name in view.modes)
    return (error for error in errors if not (balanced and error[0].startswith(("scale", "balance"))))


def lamp_errors(
    view: ColoursView, values: np.ndarray, at: Local, scene: Scene, example: np.ndarray
) -> Iterator[tuple[str, float, np.ndarray]]:
    """Errors of the recorded linear channels by a slope and by a curvature of the lamp's spectrum, to which
    the white is balanced; simulated as at the values of an `example`."""
    sensor, extension = np.asarray(view.data.sensor), extended(view, example)
    position = np.linspace(-1, 1, len(sensor))[:, None]
    for name, shape in (("slope of the lamp", position), ("curvature of the lamp", 2 * position**2 - 1)):
        if size := scene.uncertainty.lamp:
            lit = sensor * (1 + size * shape)
            data = view.data._replace(sensor=lit * (sensor.sum(axis=0) / lit.sum(axis=0)))
            [seen] = extension.signals(data, values, [(Number(0), 0.0)])
            change = seen.reshape(-1, 3) - np.asarray(at.colours)
            yield name, size, change @ view.response(at).T / size


def unlike(part: Part) -> bool:
    """True for colours that are not those of the film, whatever their camera."""
    assert isinstance(part.curve, ColourCurve)
    difference = 0.0 if part.curve.difference is None else float(np.max(part.curve.difference))
    contradicted = part.sigma_from == "given" and part.chi2_reduced > _CONTRADICTED
    return bool(difference > _UNLIKE or contradicted)


def accuracy(view: ColoursView, sigma: float) -> Accuracy:
    """The residuals, in units of the median `sigma` of the data, that no camera makes."""
    span = 100.0 if view.encoding.mix[0, 1] else 1.0  # L*, a*, b*
    return Accuracy(largest=LARGEST * span / sigma)
