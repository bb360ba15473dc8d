"""Thickness of a film at every pixel of a photograph, or along a strip, from its colours."""

import os
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from pellicle.colour import ColourInverse
from pellicle.colour.inverse import ColourThickness, Errors
from pellicle.colour.observers import Sensor
from pellicle.data.cameras import Camera, Sight, sight
from pellicle.data.colours import USUAL_NOISE
from pellicle.data.photographs import Photograph, Region, parse_regions, read_photograph
from pellicle.data.photographs import strip as strip_of
from pellicle.data.read_colours import against_white, check_photograph, white_balance_error
from pellicle.errors import UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES
from pellicle.fitting.film.camera_errors import channel_errors
from pellicle.fitting.film.parameters import varied_and_kept
from pellicle.scene.film import Scene
from pellicle.scene.free import Free
from pellicle.scene.instrument import Drift
from pellicle.signals.limits import noise_of
from pellicle.simulation.colours import colour_table, varied_layer

EXPOSURE = (0.01, 100.0)
"""Range of a free scale, which a soap film of 1 % and an overexposed mirror need."""
ORDERS = 4, 8
"""Thicknesses of each pixel that are kept, and those among which neighbours choose."""


class ThicknessMap(NamedTuple):
    """Thicknesses of a film along a strip, arrays (positions, ...), or of pixels, (height, width, ...).

    `colours` (..., 3) are the measured ones, as coded, and `fitted` those of the most probable thickness;
    `found` has the thicknesses, most probable first. `position` (positions,) is in pixels from the start of
    the strip, None for a region.
    """

    colours: np.ndarray
    fitted: np.ndarray
    found: ColourThickness
    position: np.ndarray | None
    where: str  # the strip or the region, as numbers
    space: str
    notes: tuple[str, ...]
    path: str
    sha256: str

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.found.status.shape))
        return f"{self.path}: thickness at {shape} positions, {100 * self.converged:.3g} % converged"

    @property
    def converged(self) -> float:
        """Share of the positions with one thickness, by their own colour or by their neighbours."""
        return float(np.mean(np.isin(self.found.status, ["converged", BY_NEIGHBOURS])))


def map_photograph(
    data: str | os.PathLike[str],
    scene: Scene,
    *,
    strip: Any = None,
    region: Any = None,
    space: str | None = None,
    observer: str = "1931",
    illuminant: str = "D65",
    lamp: str | os.PathLike[str] | None = None,
    sensitivities: str | os.PathLike[str] | None = None,
    gamma: float = 1.0,
    white: Any = None,
    flat_field: str | os.PathLike[str] | None = None,
    layer: str | None = None,
    noise: float | None = None,
    neighbours: bool = False,
) -> ThicknessMap:
    """Compute the thickness at each pixel of a photograph; arguments as of `pellicle.map`."""
    if strip is not None and region is not None:
        raise UsageError("`strip` and `region` exclude each other")
    bounds: Any = getattr(scene.layers[varied_layer(scene, layer)], "thickness", None)
    if not isinstance(bounds, Free):
        raise UsageError("the thickness of the map must be free, between two bounds")
    photograph = read_photograph(data)
    space = check_photograph(photograph, space)
    paths = [None if path is None else os.fspath(path) for path in (lamp, sensitivities)]
    transmitted = scene.light.signal == "T"
    seen = sight(Camera(observer, illuminant, *paths, gamma=gamma, transmitted=transmitted), space)
    photograph, reference, notes = against_white(photograph, seen.coding, white, flat_field)
    linear, position, where, note = _chosen(photograph, seen, strip, region)
    exposed = linear / reference
    coded = seen.coding.encode(exposed, seen.coding.roots(exposed))
    clipped = np.mean(np.any((coded <= 0) | (coded >= 1), axis=-1))
    sigma = USUAL_NOISE[space] if noise is None else noise_of("a photograph", noise)
    told = [*photograph.notes, *seen.notes, *notes, note, f"noise {sigma:.2g} of each channel"]
    told += _kept(scene, layer)
    if clipped > 0:
        told.append(f"{100 * clipped:.3g} % of the positions are clipped in a channel")
    spread = np.full(3, sigma)
    if space == "rgb":  # a camera's channels are linear, with the σ of their median
        middle = np.maximum(np.median(linear.reshape(-1, 3), axis=0), 1e-3)
        spread = sigma * gamma * middle ** (1 - 1 / gamma)
    errors = partial(
        _camera_errors,
        *(scene, space),
        balance=white_balance_error(white, flat_field),
        coded=space == "srgb" or gamma != 1,
        # all pixels have one camera: what mixes its channels hardly tells neighbours apart
        mixed=not neighbours and (space == "srgb" or sensitivities is None),
    )
    inverse = _inverse(scene, seen.sensor, space, bounds, layer, spread, errors)
    films = inverse(coded if space == "srgb" else exposed, ORDERS[neighbours])
    if neighbours:
        films, decided = _by_neighbours(films)
        told.append(decided)
    about = where, space, tuple(told), photograph.path, photograph.sha256
    return ThicknessMap(coded, _fitted(films, inverse, seen), films, position, *about)


def _kept(scene: Scene, layer: str | None) -> list[str]:
    """A note on the free numbers of a scene that the colour of a pixel does not fit."""
    fitted, kept = varied_and_kept(scene, varied_layer(scene, layer))
    kept += ["instrument.offset = 0"] if isinstance(scene.instrument.offset, Drift) else []
    return [f"each colour gives {fitted} alone, kept are {', '.join(kept)}"] if kept else []


def _camera_errors(scene: Scene, space: str, linear: np.ndarray, **camera: Any) -> list[np.ndarray]:
    """Changes of linear channels (..., 3) by one standard uncertainty of each error of a camera, which is
    described as for `channel_errors`."""
    scaled = not isinstance(scene.instrument.scale, Drift)
    every = channel_errors(linear, scene.uncertainty, space, scaled=scaled, **camera)
    return [size * change for _, size, change in every if size]


def _chosen(
    photograph: Photograph, seen: Sight, strip: Any, region: Any
) -> tuple[np.ndarray, np.ndarray | None, str, str]:
    """Linear channels of a strip, means across it, or of a rectangle, by default the whole photograph.

    Also their positions along the strip, where they are, and a note on them. Raises UsageError for those
    outside.
    """
    if strip is not None:
        taken = strip_of(photograph, strip)
        where = strip if isinstance(strip, str) else ",".join(map(str, strip))
        linear = seen.coding.decoded(taken.pixels).mean(axis=1, dtype=float)
        note = f"strip {where}: {len(linear)} positions, means of {taken.pixels.shape[1]} pixels"
        return linear, taken.position, where, note
    box, *others = [Region(0, 0, *photograph.size)] if region is None else parse_regions(region)
    if others:
        raise UsageError("`region` of a map must be one rectangle")
    pixels = box.pixels(photograph).reshape(box.height, box.width, 3)
    return seen.coding.decoded(pixels), None, str(box), f"region {box}: {box.width * box.height} pixels"


def _fitted(films: ColourThickness, inverse: ColourInverse, seen: Sight) -> np.ndarray:
    """Coded colours (..., 3) of the most probable thicknesses, at their exposures."""
    best, exposure = films.thickness[..., 0], films.exposure[..., 0]
    channels = [np.interp(best, inverse.thickness, column) for column in inverse.channels[:, 0].T]
    fitted = np.stack(channels, axis=-1) * exposure[..., None]
    return seen.coding.encode(fitted, seen.coding.roots(fitted))


def _by_neighbours(films: ColourThickness) -> tuple[ColourThickness, str]:
    """Thicknesses with the order that neighbouring positions decide first, where the colours do not, and
    words on that."""
    from xarray import Dataset  # slow to import

    from pellicle.mapping.continuity import decided_by_neighbours, evidence

    place = ("y", "x")[-films.status.ndim :]
    above = -2 * np.log(films.probability / films.probability[..., :1])
    codes = np.vectorize(CODES.get)(films.status)
    dataset = Dataset(
        {
            "status": (place, codes),
            "thickness": (place, films.thickness[..., 0]),
            "thickness_stderr_noise": (place, films.stderr[..., 0]),
            "rival_delta_chi2": (place, above[..., 1]),
            "order_thickness": ((*place, "order"), films.thickness),
            "order_delta_chi2": ((*place, "order"), above),
        }
    )
    made = decided_by_neighbours(dataset)
    first = np.asarray(made["thickness"])[..., None]
    # the chosen order, then the others as they were
    order = np.argsort(films.thickness != first, axis=-1, kind="stable")
    columns = {
        name: np.take_along_axis(x, order, axis=-1) for name, x in films._asdict().items() if name != "status"
    }
    status = np.where(np.asarray(made["status"]) == CODES[BY_NEIGHBOURS], BY_NEIGHBOURS, films.status)
    return films._replace(**columns, status=status), str(evidence(made))


def _inverse(
    scene: Scene,
    eye: Sensor,
    space: str,
    bounds: Free,
    layer: str | None,
    spread: np.ndarray,
    errors: Errors,
) -> ColourInverse:
    """The inverse of the film's colours, whose channels have the standard deviations `spread` and these
    errors of the camera."""
    light: Any = scene.light.angle
    if np.ndim(light):
        raise UsageError("a photograph has one angle of incidence: give the scene one number as `angle`")
    angle = float(getattr(light, "start", light))
    low = max(angle - 1.0, 0.0)  # a table needs a range of angles
    table = colour_table(scene, (bounds.lower, bounds.upper), (low, low + 1.0), layer, eye=eye)
    scale = scene.instrument.scale
    exposure = EXPOSURE if isinstance(scale, Drift) else float(getattr(scale, "start", scale))
    coding = "srgb" if space == "srgb" else "xyz"
    return ColourInverse.build(table, angle, space=coding, sigma=spread, exposure=exposure, errors=errors)
