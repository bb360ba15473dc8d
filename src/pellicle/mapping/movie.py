"""Movie: thickness of a draining or drying film at each place and time from the frames of a camera.

Gain and dark level of each channel come from the fringes of the movie itself. Continuity in time and space
decides the order of interference, with the black film as its anchor where one appears. A state-space smoother
then joins all times of a place, linearised around its path, again after each pass.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from itertools import pairwise
from logging import getLogger
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.cameras import Camera, Sight, sight
from pellicle.data.movies import Movie, frames_of, read_movie
from pellicle.data.read_colours import check_photograph
from pellicle.errors import UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES, NO_DATA, STATUSES
from pellicle.fitting.result import Status
from pellicle.mapping.growth import TIME
from pellicle.mapping.movie_fit import levels_of, smoothed_place
from pellicle.mapping.movie_light import BLACK, FilmLight, film_light, is_gone, noise_of, parts_of
from pellicle.mapping.movie_paths import FAR, TURN, Paths, paths_of
from pellicle.mapping.series_result import SURE, decided_share, status_counts
from pellicle.mapping.thinning_law import Law, Looks, thinning_laws
from pellicle.mapping.trace import lost
from pellicle.mapping.trace_light import LEAST, Light
from pellicle.mapping.trace_path import Course
from pellicle.scene.film import Scene
from pellicle.scene.free import MONOTONIC, SLOWLY, Free
from pellicle.simulation.colours import varied_layer

if TYPE_CHECKING:
    from xarray import Dataset

log = getLogger(__name__)

_FOR_GAIN = 12
"""Places that give gain and dark level."""


@dataclass(frozen=True, eq=False)
class MovieResult:
    """Thickness of a film in a movie.

    - `dataset`: along `time` and the axes of the places `thickness`, `thickness_stderr`,
      `thickness_stderr_noise`, `rate`, `rate_stderr`, `status` in codes of `STATUSES`, `rival_delta_chi2`;
      along `time` `mean_thickness` of the places that are decided then.
    - `laws`: thinning laws by the number of a chosen place, the best one first; `places`: these.
    - `breaks`: times before which the film changed abruptly; `black`: the place and the time at which a black
      film is seen first.
    - `warnings`, `notes`: sentences.
    """

    dataset: Dataset
    laws: tuple[list[Law], ...]
    places: tuple[int, ...]
    breaks: tuple[float, ...]
    black: tuple[int, float] | None
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    path: str

    @property
    def dims(self) -> tuple[str, ...]:
        """Axes of the places."""
        return tuple(str(dim) for dim in self.dataset["status"].dims[1:])

    @property
    def status(self) -> dict[str, int]:
        """Number of thicknesses of each status that occurs."""
        return status_counts(self.dataset["status"].values)

    @property
    def decided(self) -> float:
        """Share of the places and times with data whose order is decided."""
        return decided_share(self.status)

    def where(self, place: int) -> str:
        """Words for a place, in pixels."""
        at = np.unravel_index(place, self.dataset["status"].shape[1:])
        named = zip(self.dims, at, strict=True)
        return ", ".join(f"{dim} {float(self.dataset[dim][i]):.4g}" for dim, i in named)

    def __repr__(self) -> str:
        frames, *shape = self.dataset["status"].shape
        size = " x ".join(map(str, shape))
        return f"movie of {frames} frames at {size} places, {100 * self.decided:.3g} % decided"


def fit_movie(
    source: Any,
    scene: Scene,
    *,
    time_from: str | None = None,
    frame_rate: float | None = None,
    strip: Any = None,
    region: Any = None,
    points: Any = None,
    wavelengths: Any = None,
    space: str | None = None,
    observer: str = "1931",
    illuminant: str = "D65",
    lamp: str | os.PathLike[str] | None = None,
    sensitivities: str | os.PathLike[str] | None = None,
    gamma: float = 1.0,
    flat_field: str | os.PathLike[str] | None = None,
) -> MovieResult:
    """Fit the frames of a movie; arguments as of `pellicle.series`."""
    frames = frames_of(source, time_from, frame_rate)
    if len(frames.time) < LEAST:
        raise UsageError(
            f"{frames.path}: a movie needs {LEAST} frames at least, and this has {len(frames.time)}"
        )
    first = frames.frame(0)
    grey = first.pixels.shape[2] == 1
    nm = _filter(wavelengths, grey, frames.path)
    if grey and space not in (None, "rgb", "srgb"):
        raise UsageError(f"{frames.path}: a movie has the signal srgb or rgb, not {space}")
    space = (space or "rgb") if grey else check_photograph(first, space)
    paths = [None if x is None else os.fspath(x) for x in (lamp, None if grey else sensitivities)]
    seen = sight(Camera(observer, illuminant, *paths, gamma=gamma), space)
    film = film_light(scene, seen, nm)
    movie = read_movie(frames, seen.coding, strip_ends=strip, region=region, flat_field=flat_field)
    told = (f"light of {nm:g} nm",) if nm is not None else seen.notes
    movie = movie._replace(notes=(*movie.notes, *told))
    return _fitted(movie, scene, film, seen, nm, points)


def _filter(wavelengths: Any, grey: bool, path: str) -> float | None:
    """The wavelength of grey frames in nm, None of frames in colour. Raises UsageError."""
    if not grey:
        if wavelengths is not None:
            raise UsageError(f"{path}: has frames in colour, and `wavelengths` is of grey ones: leave it out")
        return None
    try:
        nm = float(wavelengths)
    except (TypeError, ValueError):
        nm = np.nan
    if not np.isfinite(nm) or nm <= 0:
        raise UsageError(
            f"{path}: has grey frames, which need the one wavelength of their filter in nm: give"
            " `wavelengths=550`"
        )
    return nm


def _fitted(
    movie: Movie, scene: Scene, film: FilmLight, seen: Sight, nm: float | None, points: Any
) -> MovieResult:
    """Fit each part of the movie that shows one film, and put the results together."""
    thickness: Free = scene.layers[varied_layer(scene)].thickness  # type: ignore[union-attr]
    turn = {MONOTONIC: np.inf, SLOWLY: 0.0}.get(thickness.varies or "", TURN)
    course = Course(turn, FAR * film.order)
    noise, span = noise_of(movie.light, movie.step)
    parts, out = parts_of(movie.light, movie.time, span)
    values = np.where(out[:, None, None], np.nan, movie.light)
    relative = float(np.hypot(scene.uncertainty.index, scene.uncertainty.wavelength / (nm or 550.0)))
    chosen = _chosen(points, movie)
    answer = _Answer.empty(values.shape[:2], chosen, relative)
    every, told = list[Paths](), list[str]()
    for part in parts:
        some, time = values[part.start : part.stop], movie.time[part.start : part.stop]
        if len(part) < LEAST:
            told.append(f"{len(part)} frames from {time[0]:.5g} {movie.unit} on are too few for a fit")
            continue
        if every and is_gone(some, film, every[0].gain, span):
            told.append(f"the film is gone from {time[0]:.5g} {movie.unit} on")
            continue
        lights = [Light(some[:, p], time, noise, span, (None, None)) for p in range(some.shape[1])]
        found = paths_of(lights, movie.shape, film, course)
        if found is not None:
            every.append(found)
            answer.put(part, lights, film, found)
    if not every:
        raise UsageError(f"{movie.path}: no thickness within its bounds follows the light: widen them")
    dataset = answer.dataset(movie)
    laws = tuple(answer.laws(movie.time, place) for place in chosen)
    breaks = tuple(float(movie.time[part.start]) for part in parts[1:])
    black = answer.first_black(movie.time)
    told += _warnings(movie, dataset, parts, out, black is not None)
    if black is not None:
        at = f"{black[1]:.5g} {movie.unit}"
        told.append(f"a film that stays dark from {at} on is taken as black, thinner than {BLACK:g} nm")
    shown = "; ".join(f"{a:.3g} and {b:.3g}" for a, b in answer.gains[0])
    notes = (*movie.notes, f"gain and dark level of each channel, from the fringes: {shown}")
    return MovieResult(dataset, laws, chosen, breaks, black, tuple(told), notes, movie.path)


@dataclass
class _Answer:
    """Arrays (times, places) of a result while it is filled, and looks at the chosen places; `relative` is
    the error that all thicknesses have in common."""

    values: dict[str, np.ndarray]
    status: np.ndarray
    chosen: tuple[int, ...]
    relative: float
    looks: dict[int, Looks] = field(default_factory=dict)
    blacks: dict[int, int] = field(default_factory=dict)
    gains: list[np.ndarray] = field(default_factory=list)

    @classmethod
    def empty(cls, shape: tuple[int, ...], chosen: tuple[int, ...], relative: float) -> _Answer:
        names = "thickness", "noise", "common", "rate", "rate_noise", "rate_common", "rival"
        values = {name: np.full(shape, np.nan) for name in names}
        return cls(values, np.zeros(shape, np.uint8), chosen, relative)

    def put(self, part: range, lights: list[Light], film: FilmLight, found: Paths) -> None:
        """Smooth the paths of a part, from the surest place on, and take over the answer."""
        rows, some = slice(part.start, part.stop), list(found.found)[:: -(-len(found.found) // _FOR_GAIN)]
        levels = levels_of([lights[p] for p in some], [found.found[p] for p in some], film, found.gain)
        self.gains.append(levels.gain)
        for place, path in found.found.items():
            light = lights[place]
            fit = smoothed_place(light, path, film, levels)
            known = np.asarray(np.isfinite(light.values).all(axis=1))
            columns = fit.columns(levels) | {"rival": np.minimum(path.rival, found.sure)}
            for name, column in columns.items():
                self.values[name][rows, place] = np.where(known, column, np.nan)
            if place in self.chosen:
                looks = fit.looks(self.relative)
                whole = self.looks.setdefault(
                    place, Looks(*(np.full((len(self.status), *x.shape[1:]), np.nan) for x in looks))
                )
                for column, values in zip(whole, looks, strict=True):
                    column[rows] = values
            status = np.full(len(known), CODES[BY_NEIGHBOURS], np.uint8)
            astray = lost(fit.residual, light)
            if path.black is not None:
                status[path.black :] = CODES[str(Status.CONVERGED)]
                self.blacks[place] = part.start + path.black
            status[np.minimum(path.rival, found.sure) <= SURE] = CODES[str(Status.AMBIGUOUS)]
            status[astray] = CODES[str(Status.MISFIT)]
            self.status[rows, place] = np.where(known, status, CODES[NO_DATA])

    def first_black(self, time: np.ndarray) -> tuple[int, float] | None:
        """The place that is black first, and from when on."""
        if not self.blacks:
            return None
        place = min(self.blacks, key=self.blacks.__getitem__)
        return place, float(time[self.blacks[place]])

    def laws(self, time: np.ndarray, place: int) -> list[Law]:
        """Thinning laws of a chosen place, without its black film and undecided times."""
        if place not in self.looks:
            return []
        decided = self.status[:, place] == CODES[BY_NEIGHBOURS]
        known = np.where(decided, self.values["thickness"][:, place], np.nan)
        return thinning_laws(time, known, self.looks[place])

    def dataset(self, movie: Movie) -> Dataset:
        """The result with its axes."""
        import xarray

        dims, shape = (TIME, *movie.coords), (len(movie.time), *movie.shape)
        arrays = {name: x.reshape(shape).astype(np.float32) for name, x in self.values.items()}
        rate = f"nm/{movie.unit}"
        for name, of in ("stderr", "thickness"), ("rate_stderr", "rate"):
            before = "" if of == "thickness" else "rate_"
            common = np.hypot(arrays[f"{before}common"], self.relative * arrays[of])
            arrays[name] = np.hypot(arrays[f"{before}noise"], common)
        about = (
            ("thickness", "thickness", "thickness", "nm"),
            ("thickness_stderr", "stderr", "standard error of the thickness", "nm"),
            ("thickness_stderr_noise", "noise", "standard error of the thickness, of the noise alone", "nm"),
            ("rate", "rate", "rate of change of the thickness", rate),
            ("rate_stderr", "rate_stderr", "standard error of the rate", rate),
            ("rival_delta_chi2", "rival", "delta chi2 of the best path through another branch", "1"),
        )
        made: dict[str, Any] = {
            name: (dims, arrays[key], {"long_name": words, "units": unit}) for name, key, words, unit in about
        }
        flags = {"flag_values": list(range(len(STATUSES))), "flag_meanings": " ".join(STATUSES)}
        made["status"] = dims, self.status.reshape(shape), flags
        decided = np.isin(self.status, [CODES[BY_NEIGHBOURS], CODES[str(Status.CONVERGED)]])
        number = decided.sum(axis=1)
        total = np.where(decided, self.values["thickness"], 0.0).sum(axis=1)
        mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
        words = {"long_name": "mean thickness of the places that are decided", "units": "nm"}
        made["mean_thickness"] = TIME, mean, words
        axes: dict[str, Any] = {TIME: (TIME, movie.time, {"units": movie.unit, "axis": "T"})}
        for dim, x in movie.coords.items():
            axes[dim] = dim, x, {"units": "pixel", "axis": dim.upper(), "long_name": f"{dim} in pixels"}
        return xarray.Dataset(made, axes, {"Conventions": "CF-1.11", "source": movie.path})


def _chosen(points: Any, movie: Movie) -> tuple[int, ...]:
    """The places nearest to points "x,y;x,y", or "x;x" along a line; by default three of them."""
    axes = list(movie.coords.values())
    if points is None:
        quarters = [int(share * (len(axes[0]) - 1)) for share in (0.25, 0.5, 0.75)]
        middle = [len(axis) // 2 for axis in axes[1:]]
        every = [int(np.ravel_multi_index((i, *middle), movie.shape)) for i in quarters]
        return tuple(dict.fromkeys(every))
    groups = points.split(";") if isinstance(points, str) else points
    chosen = []
    for group in groups:
        try:
            numbers = [float(x) for x in (group.split(",") if isinstance(group, str) else np.ravel(group))]
        except ValueError:
            numbers = []
        if len(numbers) != len(axes):
            form = "x,y" if len(axes) == 2 else "x along the line"
            raise UsageError(f"`points` of this movie must be {form} in pixels, got {group!r}")
        for (dim, axis), x in zip(movie.coords.items(), numbers[::-1], strict=True):
            half = 0.5 * float(axis[1] - axis[0]) if len(axis) > 1 else np.inf
            if not axis[0] - half <= x <= axis[-1] + half:
                raise UsageError(
                    f"`points` {group!r} is no place of this movie: {dim} is from {axis[0]:g} to {axis[-1]:g}"
                )
        nearest = [int(np.argmin(np.abs(axis - x))) for axis, x in zip(axes, numbers[::-1], strict=True)]
        chosen.append(int(np.ravel_multi_index(nearest, movie.shape)))
    return tuple(dict.fromkeys(chosen))


def _warnings(movie: Movie, dataset: Dataset, parts: list[range], out: np.ndarray, black: bool) -> list[str]:
    told, time, unit = [], movie.time, movie.unit
    status = dataset["status"].values
    for part in parts[1:]:
        when = f"{time[part.start]:.5g} {unit}"
        told.append(f"the film ruptures or the scene changes before {when}: each part is fitted by itself")
    if out.any():
        when = f"from {time[int(np.argmax(out))]:.5g} {unit} on"
        told.append(f"{int(out.sum())} frames show something else, {when}: left out")
    usual = float(np.median(np.diff(time)))
    gaps = [(a, b) for a, b in pairwise(time) if b - a > 5 * usual]
    told += [f"no frames between {a:.5g} and {b:.5g} {unit}" for a, b in gaps[:6]]
    known = status != CODES[NO_DATA]
    if share := np.mean(status[known] == CODES[str(Status.AMBIGUOUS)]) if known.any() else 0.0:
        told.append(
            f"the order of {100 * share:.3g} % of the thicknesses is not decided"
            + ("" if black else ": no black film is seen that would anchor it")
        )
    if share := np.mean(status[known] == CODES[str(Status.MISFIT)]) if known.any() else 0.0:
        told.append(f"the model does not follow the light of {100 * share:.3g} % of the places and times")
    return told
