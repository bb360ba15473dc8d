"""Movies of soap films that drain, by a simulator of its own: order, anchor, breaks, laws and the command."""

import html
import json

import numpy as np
import pytest
import tifffile
import xarray
from PIL import Image

import pellicle as pl
from pellicle.cli import app
from pellicle.colour.spaces import camera_encoding
from pellicle.data.movies import frames_of, is_movie, read_movie
from pellicle.errors import DataError, UsageError
from pellicle.mapping.movie import _chosen
from pellicle.mapping.movie_fit import levels_of
from pellicle.mapping.movie_light import FilmLight, black_from, is_gone, noise_of, parts_of
from pellicle.mapping.movie_paths import FAR, TURN, paths_of
from pellicle.mapping.series_result import SURE
from pellicle.mapping.thinning_law import Looks, thinning_laws
from pellicle.mapping.trace_light import Light
from pellicle.mapping.trace_path import Course

INDEX, FILTER = 1.33, 550.0
ORDER = FILTER / 2 / INDEX
TIME = np.linspace(0.0, 100.0, 160)
PLACE = np.arange(16) / 16
BANDS = np.arange(390.0, 721.0, 15.0)
CAMERA = np.exp(-(((BANDS[:, None] - [610, 540, 460]) / 25) ** 2))
GRID = np.linspace(0.0, 1500.0, 601)


def airy(thickness, nm=FILTER):
    """Reflectance of a film in air at normal incidence."""
    face = ((INDEX - 1) / (INDEX + 1)) ** 2
    half = np.sin(2 * np.pi * INDEX * np.asarray(thickness) / nm) ** 2
    return 4 * face * half / ((1 - face) ** 2 + 4 * face * half)


def camera(thickness, colour):
    """Light (..., channels) of a gain of 1: of a filter, or of three channels."""
    if not colour:
        return airy(thickness)[..., None]
    weights = CAMERA / CAMERA.sum(axis=0)
    return sum(airy(thickness, nm)[..., None] * row for nm, row in zip(BANDS, weights, strict=True))


def seen(thickness, colour=False, noise=0.01, seed=0):
    """Light (times, places, channels) with unknown gain and dark level, and noise as a share of its range."""
    gain, dark = ((2.3, 2.0, 1.7), (0.03, 0.02, 0.04)) if colour else ((2.3,), (0.06,))
    light = np.array(dark) + np.array(gain) * camera(thickness, colour)
    size = noise * np.array(gain) * camera(GRID, colour).max(axis=0)
    return light + size * np.random.default_rng(seed).standard_normal(light.shape)


def wedge(duration, thickest=1100.0, least=10.0):
    """Thickness (times, places) of a wedge that thins exponentially, to a black film."""
    return np.maximum(thickest * (0.15 + 0.85 * PLACE) * np.exp(-TIME[:, None] / duration), least)


def front(start):
    """A wedge over which a black film spreads from the top, with a sharp edge."""
    return np.where((TIME[:, None] - start) / 100 > PLACE, 10.0, wedge(60.0))


def paths(thickness, colour=False, turn=TURN, **about):
    """Paths of all places, their distance from the truth in nm (times, places), their light and its model."""
    light = seen(thickness, colour, **about)
    noise, span = noise_of(light, 1e-4)
    lights = [Light(light[:, p], TIME, noise, span, (None, None)) for p in range(light.shape[1])]
    film = FilmLight(GRID, camera(GRID, colour), ORDER, True)
    found = paths_of(lights, (len(lights),), film, Course(turn, FAR * ORDER))
    away = np.stack([found.found[p].thickness for p in range(len(lights))], axis=1) - thickness
    return found, away, lights, film


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thickness", "colour"),
    [
        pytest.param(wedge(20.0), False, id="it gets black"),
        pytest.param(front(40.0), False, id="black film spreads"),
        pytest.param(wedge(60.0), True, id="in colour, never black"),
        pytest.param(wedge(20.0), True, id="in colour"),
    ],
)
def test_the_order_is_that_of_the_film(thickness, colour):
    found, away, lights, film = paths(thickness, colour)
    assert found.sure > SURE
    # windows blur a sharp edge
    assert np.mean(np.abs(away) < 0.25 * ORDER) > 0.97
    assert np.mean(np.abs(away) < 0.75 * ORDER) == 1
    black = {p for p, path in found.found.items() if path.black is not None}
    assert black == {int(p) for p in np.flatnonzero((thickness[-9:] < 25).all(axis=0))}
    if not colour and len(black) == 16:  # without a sharp edge
        some = range(0, 16, 4)
        levels = levels_of([lights[p] for p in some], [found.found[p] for p in some], film, found.gain)
        error = np.sqrt(np.sum(levels.effects[:, levels.by_noise] ** 2, axis=1))
        assert np.all(np.abs(levels.gain - [2.3, 0.06])[0] < 3 * error)
        assert error[0] < 0.01 * 2.3 < np.abs(found.gain[0, 0] - 2.3)  # that of the paths alone


def test_one_colour_without_a_black_film_decides_no_order():
    found, *_ = paths(wedge(60.0))
    assert found.sure < SURE


@pytest.mark.parametrize("law", [lambda t: np.exp(-t / 60), lambda t: (1 + t / 30) ** -0.5])
def test_a_dark_fringe_is_no_black_film(law):
    """The movie ends while the top passes a dark fringe of the first order."""
    for last in ORDER + np.array([20.0, 0.0, -20.0]):
        thickness = last * (1 + PLACE) * (law(TIME) / law(TIME[-1]))[:, None]
        light = seen(thickness)
        noise, span = noise_of(light, 1e-4)
        lights = [Light(light[:, p], TIME, noise, span, (None, None)) for p in range(16)]
        film = FilmLight(GRID, camera(GRID, False), ORDER, True)
        assert black_from(lights, (16,), film, np.array([[2.3, 0.06]])) == {}


def test_jumps_of_all_places_are_breaks_or_left_out():
    light = seen(wedge(60.0))
    _, span = noise_of(light, 1e-4)
    gone, shutter = light.copy(), light.copy()
    gone[90:] = seen(np.zeros((70, 16)))
    shutter[50:54] = 0.0
    film, gain = FilmLight(GRID, camera(GRID, False), ORDER, True), np.array([[2.3, 0.06]])
    parts, out = parts_of(gone, TIME, span)
    assert parts == [range(90), range(90, 160)]
    assert not out.any()
    assert is_gone(gone[90:], film, gain, span)
    assert not is_gone(gone[:90], film, gain, span)
    parts, out = parts_of(shutter, TIME, span)
    assert parts == [range(160)]
    assert list(np.flatnonzero(out)) == [50, 51, 52, 53]
    kept = np.r_[0:60, 66:160]  # frames are missing
    assert parts_of(light[kept], TIME[kept], span)[0] == [range(154)]


def laws_of(time, thickness, off, stderr=0.5, common=None):
    """Laws of looks that are `off` a thickness, with independent errors and one in common."""
    column = np.zeros((len(time), 0)) if common is None else common[:, None]
    return thinning_laws(time, thickness, Looks(thickness + off, np.full(len(time), stderr), column))


@pytest.mark.parametrize("seed", range(3))
def test_laws_of_thinning(seed):
    noise = np.random.default_rng(seed).normal(0, 0.5, 160)
    time = TIME + 5
    power = laws_of(time, 2000 * time**-0.5, noise)
    assert {law.name for law in power[:2]} == {"power", "power-shifted"}
    value, error = next(law for law in power if law.name == "power").numbers["exponent"]
    assert abs(value - 0.5) < 4 * error < 0.02
    exponential = laws_of(TIME, 900 * np.exp(-TIME / 40), noise)[0]
    assert exponential.name == "exponential"
    value, error = exponential.numbers["time constant"]
    assert abs(value - 40) < 4 * error < 1.5
    np.testing.assert_allclose(exponential.thickness(TIME), 900 * np.exp(-TIME / 40), rtol=0.02)
    assert laws_of(TIME[:5], np.ones(5), noise[:5]) == []


def test_errors_of_laws_hold_errors_that_all_times_have_in_common():
    """A gain that is off bends all thicknesses coherently, by less than the noise of each."""
    bend, away = TIME / 100, []
    for seed in range(16):
        random = np.random.default_rng(seed)
        off = random.normal(0, 2, 160) + random.standard_normal() * bend
        law = next(
            x for x in laws_of(TIME, 900 * np.exp(-TIME / 40), off, 2, bend) if x.name == "exponential"
        )
        value, error = law.numbers["time constant"]
        away.append((value - 40) / error)
    assert np.mean(np.abs(away) < 1.96) >= 0.9
    assert 0.6 < np.sqrt(np.mean(np.square(away))) < 1.3


def written(folder, light, bits=8, skipped=()):
    """Grey frames, as wide as 6 pixels, by number."""
    folder.mkdir()
    level = np.clip(light[..., 0] / 0.27, 0, 1) * (2**bits - 1)
    for i in set(range(len(light))) - set(skipped):
        pixels = np.repeat(np.round(level[i]).astype(np.uint8)[:, None], 6, axis=1)
        Image.fromarray(pixels).save(folder / f"img_{i:04d}.png")
    return folder


SCENE = """
[scene]
substrate = "air"

[[scene.layer]]
material = 1.33
thickness = { lower = 0, upper = 1500 }
"""


@pytest.mark.slow
def test_the_command_follows_grey_frames_to_the_black_film(tmp_path):
    thickness = wedge(20.0)
    frames = written(tmp_path / "frames", seen(thickness), skipped=range(40, 46))
    (tmp_path / "soap.toml").write_text(SCENE)
    rate, out = 159 / 100, tmp_path / "out"
    words = f"series {frames} --recipe {tmp_path}/soap.toml --frame-rate {rate} --wavelengths 550"
    assert app(f"{words} --strip 3,0,3,15 --out {out} --json") == 0
    found, kept = xarray.open_dataset(out / "series.nc"), np.r_[0:40, 46:160]
    assert found["thickness"].dims == ("time", "x")
    assert found["time"].attrs["units"] == "s"
    np.testing.assert_allclose(found["time"], TIME[kept], atol=1e-6)
    away = np.abs(found["thickness"].values - thickness[kept])
    decided = found["status"].values >= 1
    usual = found["thickness_stderr"].values
    assert np.sqrt(np.mean(away**2)) < 3
    assert np.mean(away[decided] < 2 * usual[decided]) > 0.9
    record = json.loads((out / "result.json").read_text())
    assert record["black_film"]["place"].startswith("x 0")
    best = next(law for law in record["thinning"] if law["law"] == "exponential")["parameters"]
    assert best["time constant"]["value"] == pytest.approx(20, abs=0.3)
    page = html.unescape((out / "report.html").read_text("utf-8"))
    assert f"--frame-rate {rate} --strip 3,0,3,15 --wavelengths 550" in page
    assert "strip='3,0,3,15'" in page
    assert "no frames between" in (out / "report.txt").read_text()
    assert (out / "series.csv").read_text().startswith("time_s,mean_thickness_nm,thickness_nm_x_3")


@pytest.mark.slow
def test_colours_of_a_region_until_the_film_breaks(tmp_path):
    thickness = wedge(60.0)
    light = seen(thickness, colour=True)
    light[120:] = seen(np.zeros((40, 16)), colour=True)
    frames = np.repeat(np.round(np.clip(light / 0.27, 0, 1) * 65535).astype(np.uint16)[:, :, None], 4, axis=2)
    tifffile.imwrite(tmp_path / "m.tif", frames, photometric="rgb")
    rows = "\n".join(f"{nm},{a},{b},{c}" for nm, (a, b, c) in zip(BANDS, CAMERA, strict=True))
    (tmp_path / "camera.csv").write_text(f"wavelength_nm,R,G,B\n{rows}\n")
    (tmp_path / "lamp.csv").write_text("wavelength_nm,power\n380,1\n730,1\n")
    scene = pl.Scene(pl.Layer(INDEX, pl.Free(0, 1500)), 1.0)
    seen_by = {"space": "rgb", "sensitivities": tmp_path / "camera.csv", "lamp": tmp_path / "lamp.csv"}
    about = {"frame_rate": 1.59, "region": "0,0,4,16", "points": "1,3;2,9"}
    found = pl.series(tmp_path / "m.tif", scene, **about, **seen_by)
    assert found.dims == ("y", "x")
    assert found.breaks == (pytest.approx(120 / 1.59),)
    assert any("gone" in text for text in found.warnings)
    data = found.dataset["thickness"].values
    assert np.isnan(data[120:]).all()
    assert found.decided > 0.95
    assert np.nanmax(np.abs(data[:120] - thickness[:120, :, None])) < 30
    assert len(found.places) == 2


def test_saturated_light_is_left_out(tmp_path):
    light = seen(wedge(60.0))
    light[50:60] = 1.0
    frames = frames_of(written(tmp_path / "frames", light), frame_rate=2.0)
    movie = read_movie(frames, camera_encoding(), strip_ends="3,0,3,15")
    assert np.isnan(movie.light[50:60]).all()
    assert np.isfinite(movie.light[:50]).all()
    assert "saturated: left out" in " ".join(movie.notes)


def test_points_outside_the_frames_are_refused(tmp_path):
    frames = frames_of(written(tmp_path / "frames", seen(wedge(60.0))), frame_rate=2.0)
    movie = read_movie(frames, camera_encoding(), strip_ends="3,0,3,15")
    assert _chosen("0;15", movie) == (0, 15)
    with pytest.raises(UsageError, match="'300' is no place of this movie: x is from 0 to 15"):
        _chosen("3;300", movie)


@pytest.mark.parametrize("name", ["a film.mp4", "b.gif", "c.AVI", "d.mov", "e.mkv", "f.webm"])
def test_a_compressed_movie_is_refused_with_the_command_for_frames(refuses, tmp_path, name):
    (tmp_path / name).write_bytes(b"")
    refuses(DataError, "mkdir .* && ffmpeg -i .* and fit that folder", is_movie, tmp_path / name)


def test_frames_without_times_or_wavelength_are_refused(refuses, tmp_path):
    scene = pl.Scene(pl.Layer(INDEX, pl.Free(0, 1500)), 1.0)
    frames = written(tmp_path / "frames", seen(wedge(60.0)))
    refuses(DataError, "no such file or folder", is_movie, tmp_path / "frame")
    refuses(DataError, "frame_rate", pl.series, frames, scene)
    refuses(UsageError, "wavelengths=550", pl.series, frames, scene, frame_rate=2.0)
    refuses(UsageError, "above zero", pl.series, frames, scene, frame_rate=0.0)
    refuses(UsageError, "no argument of a movie", pl.series, frames, scene, frame_rate=2.0, workers=2)
    few = written(tmp_path / "few", seen(wedge(60.0))[:5])
    refuses(UsageError, "24 frames at least", pl.series, few, scene, frame_rate=2.0)
    Image.new("L", (9, 9)).save(frames / "img_9999.png")
    refuses(
        DataError, "leave out what is no frame", pl.series, frames, scene, frame_rate=2.0, wavelengths=550
    )
    tifffile.imwrite(tmp_path / "one.tif", np.zeros((4, 4), np.uint8))
    refuses(DataError, "one page", pl.series, tmp_path / "one.tif", scene, frame_rate=2.0)
