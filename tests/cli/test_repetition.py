"""Command, program and recipe that repeat a fit: the same data and scene, whichever option was given."""

import html
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pellicle as pl
from pellicle.api.recipe_fits import Inputs, measurement
from pellicle.cli import app
from pellicle.cli.flags import SamplerFlags, SceneFlags
from pellicle.cli.inputs import inputs
from pellicle.data.fingerprint import fingerprint
from pellicle.data.options import FileOptions, FitOptions
from pellicle.fitting.result import Fit, Part
from pellicle.reporting.page.repetition import comparison_again, map_program, repetition

FILM = "film.csv --layer SiO2 --substrate Si --thickness 10:800"
PLATE = "film.csv --layer TiO2 --substrate BK7 --thickness 10:800"
COLOUR = "colours.csv --layer SiO2 --substrate Si --thickness 10:800"
CAMERA = COLOUR.replace("colours", "raw") + " --signal rgb"
PHOTOGRAPH = "film.png --layer SiO2 --substrate Si --thickness 10:800 --signal srgb --region 0,0,4,4"
ANGLES = "ellipsometry.csv --layer SiO2 --substrate Si --thickness 10:800 --angle 70"
OPTIONS = {
    "observer": (COLOUR, "1964"),
    "illuminant": (COLOUR, "A"),
    "lamp": (COLOUR, "lamp.csv"),
    "sensitivities": (CAMERA, "camera.csv"),
    "chart": (CAMERA, "chart.csv"),
    "gamma": (f"{CAMERA} --sensitivities camera.csv", "2.2"),
    "white_balance": (f"{CAMERA} --sensitivities camera.csv", "free"),
    "white": (PHOTOGRAPH, "4,4,3,3"),
    "flat_field": (PHOTOGRAPH, "white.png"),
    "transmitted": (COLOUR, None),
    "spectrum": ("several.csv --layer SiO2 --substrate Si --thickness 10:800 --signal R", "second"),
    "signal": (PLATE.replace("film", "unnamed"), "T"),
    "polarisation": (f"{FILM} --angle 60", "s"),
    "range": (FILM, "500:700"),
    "columns": ("several.csv --layer SiO2 --substrate Si --thickness 10:800", "wavelength,_,R"),
    "wavelength_unit": (
        "frequencies.csv --layer SiO2 --substrate Si --thickness 10:800 --columns wavelength,R",
        "THz",
    ),
    "signal_unit": (FILM, "percent"),
    "folded": (ANGLES, None),
    "transmission": (ANGLES.replace("Si ", "BK7 "), None),
    "analyser": ("fourier.csv --layer SiO2 --substrate Si --thickness 10:800 --angle 70", "30"),
    "elements": ("mueller.csv --layer SiO2 --substrate Si --thickness 10:800 --angle 70", "m12,m33"),
    "noise": (FILM, "0.4"),
    "region": (PHOTOGRAPH.rpartition(" --region")[0], "1,1,3,3"),
    "points": (PHOTOGRAPH.rpartition(" --region")[0], "5,5"),
    "angle": (FILM, "70"),
    "reference": ("counts.csv --layer SiO2 --substrate Si --thickness 10:800", "reference.csv"),
    "reference_material": ("counts.csv --layer SiO2 --substrate Si --reference reference.csv", "BK7"),
    "dark": ("counts.csv --layer SiO2 --substrate Si --reference reference.csv", "dark.csv"),
    "loss": (FILM, "huber"),
    "tolerance": (FILM, "0.01"),
    "layer": (FILM.replace("--layer SiO2", ""), "cauchy(1.5,4000)"),
    "substrate": (FILM.replace("--substrate Si", ""), "3.9+0.02j"),
    "ambient": (FILM, "1.33"),
    "thickness": (FILM.replace("--thickness 10:800", ""), "20:400"),
    "free": (FILM, "n=-0.1:0.1"),
    "back": (PLATE, "1.33"),
    "plate_mm": (f"{PLATE} --back air", "0.5"),
    "back_collected": (f"{PLATE} --back air", "0.1:0.9"),
    "back_reflections": (f"{PLATE} --back air", "2"),
    "scale": (FILM, "free"),
    "offset": (FILM, "slow"),
    "bandwidth": (FILM, "1:8"),
    "uncertainty": (FILM, "none"),
}
"""A command for each option, and the value of the option that changes it; None for one without a value."""
ELSEWHERE = {"spot": "data/formats/test_accurion.py"}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder with a file of each kind, in which commands run."""
    nm = np.linspace(450.0, 750.0, 31)
    rise = np.arange(nm.size)

    def table(name: str, head: str, *columns: np.ndarray) -> None:
        rows = (",".join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True))
        (tmp_path / name).write_text("\n".join([head, *rows, ""]))

    table("film.csv", "wavelength_nm,reflectance", nm, 0.5 + 0.01 * rise)
    table("frequencies.csv", "x,R", 299792.458 / nm, 0.2 + 0.001 * rise)
    table("unnamed.csv", "wavelength_nm,light", nm, 0.2 + 0.001 * rise)
    table("several.csv", "wavelength_nm,first,second", nm, 0.2 + 0.001 * rise, 0.4 - 0.001 * rise)
    table("ellipsometry.csv", "wavelength_nm,psi,delta", nm, 30 + 0.1 * rise, 100.0 + rise)
    table("fourier.csv", "wavelength_nm,alpha,beta", nm, -0.1 - 0.001 * rise, 0.2 + 0.001 * rise)
    elements = [0.1 * np.sin(rise + j) for j in range(4)]
    table("mueller.csv", "wavelength_nm,m12,m33,m34,m21", nm, *elements)
    table("counts.csv", "wavelength_nm,counts", nm, 9000 + 10.0 * rise)
    table("reference.csv", "wavelength_nm,counts", nm, 20000.0 + rise)
    table("dark.csv", "wavelength_nm,counts", nm, 100.0 + 0 * rise)
    table("colours.csv", "R,G,B", *np.array([[120.0, 90, 60], [110, 95, 80]]).T)
    table("raw.csv", "R,G,B", *np.array([[0.2, 0.1, 0.05], [0.21, 0.12, 0.08]]).T)
    wide = np.linspace(380.0, 780.0, 41)
    bells = [np.exp(-(((wide - centre) / 30) ** 2)) for centre in (600, 540, 470)]
    table("lamp.csv", "wavelength_nm,power", wide, wide)
    table("camera.csv", "wavelength_nm,R,G,B", wide, *bells)
    patches = np.random.default_rng(0).uniform(0.05, 0.9, (12, 3))
    matrix = np.array([[0.4, 0.2, 0.1], [0.3, 0.7, 0.1], [0.2, 0.1, 0.9]])
    table("chart.csv", "R,G,B,X,Y,Z", *patches.T, *(patches @ matrix).T)
    image = pytest.importorskip("PIL.Image")
    values = np.random.default_rng(1).integers(60, 200, (8, 8, 3), dtype=np.uint8)
    image.fromarray(values).save(tmp_path / "film.png")
    image.fromarray(np.maximum(values, 200)).save(tmp_path / "white.png")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def parsed(command: str) -> Inputs:
    """Data and scenes of a command, as `pellicle fit` takes them."""
    _, bound, _ = app.parse_args(shlex.split(command), print_error=False, exit_on_error=False)
    given: dict[str, Any] = {"recipe": None, **bound.arguments}
    flags = [given.get(name) for name in ("scene", "reading", "fitting")]
    return inputs(list(given.get("data", ())), given["recipe"], *flags, given.get("joint", False))


def told(made: Inputs) -> str:
    """Hash of data, scenes and settings of the fits of a command."""
    fits = [measurement(files, made.joint) for files in made.groups]
    return fingerprint(fits, made.loss, made.tolerance, made.residual)


def executed(program: str, monkeypatch) -> str:
    """Hash of data, scenes and settings of the fits of a program."""
    fits, settings = [], []

    def seen(data, scene, *, loss="least-squares", tolerance=0.0, residual=None):
        fits.append((data, scene))
        settings[:] = loss, tolerance, residual

    monkeypatch.setattr(pl, "fit", seen, raising=False)
    exec(program, {})
    return fingerprint(fits, *settings)


def test_every_option_has_a_case():
    declared = {*FileOptions.declared(), *FitOptions.declared(), *SceneFlags.__dataclass_fields__}
    assert declared == {*OPTIONS, *ELSEWHERE}


@pytest.mark.parametrize("option", OPTIONS)
def test_command_program_and_recipe_keep_an_option(option, folder, monkeypatch):
    command, value = OPTIONS[option]
    flag = f"--{option.replace('_', '-')}"
    made = parsed(f"fit {command} {flag}" + (f" {shlex.quote(value)}" if value else ""))
    [first] = made.groups[0]
    part, shown = object.__new__(Part), object.__new__(Fit)  # of a fit only the paths count
    vars(part)["data"], vars(shown)["parts"] = first.read()[0], (part,)
    saved = Path("out") / "recipe.toml"
    saved.parent.mkdir()
    saved.write_text(made.recipe([first], saved.parent), "utf-8")
    (_, again), (_, program), (_, recipe) = repetition(
        shown, made.described, lambda where: made.recipe([first], where), saved
    )
    assert executed(program, monkeypatch) == told(made)
    assert told(parsed(again.removeprefix("pellicle "))) == told(made)
    (folder / "again.toml").write_text(recipe, "utf-8")
    assert told(parsed("fit --recipe again.toml")) == told(made)
    try:
        without = told(parsed(f"fit {command}"))
    except ValueError:
        return  # it is needed
    assert without != told(made)


def test_a_flag_that_is_switched_off_is_repeated(folder):
    made = parsed(f"fit {ANGLES} --no-folded")
    part, shown = object.__new__(Part), object.__new__(Fit)
    vars(part)["data"], vars(shown)["parts"] = made.files[0].read()[0], (part,)
    (_, again), *_ = repetition(shown, made.described)
    assert "--no-folded" in shlex.split(again)
    assert told(parsed(again.removeprefix("pellicle "))) == told(made)


@pytest.mark.parametrize("tables", ["data.file", "sample"])
def test_files_with_tables_in_the_recipe_are_not_repeated_in_the_command(tables, folder):
    files = {
        "data.file": "[data]\njoint = true\n[[data.file]]\npath = 'film.csv'\n",
        "sample": "[[sample]]\nname = 'thin'\nfiles = ['film.csv']\n",
    }
    film = "[[scene.layer]]\nname = 'film'\nmaterial = 'SiO2'\nthickness = { lower = 10, upper = 800 }\n"
    (folder / "own.toml").write_text(f"[scene]\nsubstrate = 'Si'\n{film}{files[tables]}", "utf-8")
    made = parsed("fit --recipe own.toml")
    part, shown = object.__new__(Part), object.__new__(Fit)
    vars(part)["data"], vars(shown)["parts"] = made.files[0].read()[0], (part,)
    (_, again), *_ = repetition(shown, made.described)
    assert told(parsed(again.removeprefix("pellicle "))) == told(made)


def test_a_posterior_is_repeated_by_its_own_command_and_program(folder, monkeypatch):
    made = parsed(f"fit {FILM} --tolerance 0.01")
    part, shown = object.__new__(Part), object.__new__(Fit)
    vars(part)["data"], vars(shown)["parts"] = made.files[0].read()[0], (part,)
    sampler = {"walkers": 40, "seed": 7}
    saved = Path("recipe.toml")
    saved.write_text(made.recipe(made.files, Path()), "utf-8")
    described = {**made.described, "sampler": sampler}
    (_, again), (_, program), _ = repetition(shown, described, lambda where: "", saved)
    command, bound, _ = app.parse_args(shlex.split(again)[1:], print_error=False, exit_on_error=False)
    assert command.__name__ == "sample"
    assert bound.arguments["chain"] == SamplerFlags(walkers=40, seed=7)
    sampled = []
    monkeypatch.setattr(pl, "sample", lambda *given, **flags: sampled.append((given, flags)), raising=False)
    exec(program, {})
    [((data, scene), flags)] = sampled
    assert fingerprint(data, scene) == fingerprint(*measurement(made.files, made.joint))
    assert flags == {"tolerance": 0.01} | sampler


@pytest.mark.parametrize("joint", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_program_in_a_report_gives_the_numbers_of_the_command(joint, pellicle, spectrum_file, tmp_path):
    files = [spectrum_file(f"{name}.csv", seed=seed) for seed, name in enumerate("ab"[: 1 + joint])]
    how = "--layer SiO2 --substrate 3.9+0.02j --thickness 100:600 --free n --uncertainty none"
    how += " --loss huber --noise 0.003 --range 450:750 --json" + " --joint" * joint
    [found] = pellicle("fit", *files, *shlex.split(how), "--out", tmp_path / "out").objects
    page = html.unescape((tmp_path / "out" / "report.html").read_text("utf-8"))
    [program] = re.findall(r"import pellicle as pl.*?print\(fit\)", page, re.DOTALL)
    names: dict[str, Any] = {}
    exec(program, names)
    free = {p.name: (p.value, p.stderr) for p in names["fit"].parameters.values() if p.free}
    assert len(free) == 2
    assert free == {name: (p["value"], p["stderr"]) for name, p in found["parameters"].items() if p["free"]}


def test_command_and_program_repeat_a_comparison(folder, monkeypatch):
    layer = "[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 'SiO2'\nthickness = { lower = 10, upper"
    recipes = {name: str(folder / f"{name}.toml") for name in ("narrow", "wide")}
    for upper, path in zip((400, 800), recipes.values(), strict=True):
        Path(path).write_text(f"[data]\nnoise = 0.01\n{layer} = {upper} }}\n", "utf-8")
    (_, command), (_, program), *texts = comparison_again(recipes, ["film.csv", "again.csv"], 1)
    (folder / "again.csv").write_text((folder / "film.csv").read_text().replace("0.5,", "0.51,"))
    seen = []
    monkeypatch.setattr(pl, "compare", lambda *given, **how: seen.append((given, how)), raising=False)
    exec(program, {})
    [((data, scenes), how)] = seen
    assert (data.path, list(scenes), how) == ("again.csv", ["narrow", "wide"], {"residual": None})
    assert [own.layers[0].thickness.upper for own in scenes.values()] == [400, 800]
    _, bound, _ = app.parse_args(shlex.split(command)[1:], print_error=False, exit_on_error=False)
    assert bound.arguments["recipe"] == [*recipes.values()]
    assert bound.args == ("film.csv", "again.csv")
    assert [text for _, text in texts] == [Path(path).read_text("utf-8") for path in recipes.values()]


def test_a_program_of_a_map_has_its_options_and_the_scenes_of_its_recipes(folder, monkeypatch):
    film = pl.Scene(pl.Layer("SiO2", pl.Free(10, 400)), "Si")
    pl.write_recipe(film, "film.toml")
    options = {"noise": 0.01, "range": (450.0, 700.0), "workers": 4, "recipe": "the text", "resume": True}
    written = {"lamp_reference": "pl.read_recipe('film.toml').scene()"}
    program = map_program("map", "cube.nc", "film.toml", options, written)
    seen = []
    monkeypatch.setattr(pl, "map", lambda *given, **how: seen.append((given, how)), raising=False)
    exec(program, {})
    [((path, scene), how)] = seen
    assert fingerprint(scene, how.pop("lamp_reference")) == fingerprint(film, film)
    assert (path, how) == ("cube.nc", {"noise": 0.01, "range": (450.0, 700.0)})
    assert "jax" not in program
    white = {"white_reflectance": "lambda nm: pl.reflectance(nm, 0.0, 1.0, 'Si')"}
    assert 'jax_enable_x64", True)\nscene' in map_program("map", "cube.nc", "film.toml", {}, white)
