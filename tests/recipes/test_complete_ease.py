"""Models of CompleteEASE as recipes: the formulas of the media, tables, refusals by name."""

import zipfile

import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.base import known_index
from pellicle.errors import DataError
from pellicle.recipes.write import recipe_text
from pellicle.scene.free import insert, start_values

from .complete_ease_text import array, block, cauchy, line, model, oscillators, table

ANGSTROMS = (3000.0, 4500.0, 6328.0, 9000.0)
SILICON = np.array([5.0 + 4.2j, 4.67 + 0.13j, 3.88 + 0.02j, 3.67 + 0.0j])
WAVELENGTH = np.array([380.0, 520.0, 760.0])
ENERGY = 1239.841984 / WAVELENGTH
WAFER = table("SI_JAW", ANGSTROMS, SILICON)
CAUCHY = (line("A", 1.48, True), line("B", -0.0047, True), line("C", 1.2e-5))
EDGE = (line("k Amplitude", 1.3e-2, True), line("Exponent", 1.5))
CLEAR = (line("k Amplitude", 0.0), line("Exponent", 1.5))
THICK = line("Thickness # 1", 1234.5, True, 0.0, 2000.0)
LORENTZ = ("Lorentz", [line("Amp", 3.0), line("iAmp", 0.0), line("Br", 0.4), line("En", 4.1, True)], False)
DRUDE = ("Drude(RT)", [line("Resistivity (Ohm·cm)", 5e-4, True), line("Scat. Time (fs)", 6.0)], False)
GAP = [line(*x) for x in (("Amp", 99.0), ("Br", 0.7), ("Eo", 4.1), ("Eg", 3.4))]
MOTT = ("Tauc-Lorentz", GAP, True)
FILM = (THICK, cauchy("Film", *CAUCHY, *CLEAR))


@pytest.fixture
def recipe_of(write):
    return lambda *parts, **more: pl.read_recipe(write(model(*parts, **more), "film.mod"))


def complex_index(medium, wavelength=WAVELENGTH):
    value = known_index(insert(medium, start_values(medium)), wavelength)
    return value if isinstance(value, np.ndarray) else value.re + 1j * value.im


def test_layers_roughness_offset_and_back(recipe_of, tmp_path):
    back = (line("# Back Reflections", 3.0), line("% 1st Reflection", 40.0))
    native = (line("Native Oxide", 15.0), table("SIO2 JAW", ANGSTROMS, [1.49, 1.47, 1.46, 1.45]))
    rough = line("Roughness", 30.0, True, -100.0, 500.0)
    scene = recipe_of(WAFER, native, FILM, rough=rough, offset=-0.04, back=back).scene()
    assert [x.name for x in scene.layers] == ["roughness", "Film", "SIO2_JAW"]
    sizes = [x.thickness for x in scene.layers]
    assert [(x.lower, x.start, x.upper) for x in sizes[:2]] == [(0.0, 3.0, 50.0), (0.0, 123.45, 200.0)]
    assert sizes[2] == 1.5
    angle = scene.instrument.angle_shift
    assert (angle.lower, angle.start, angle.upper) == (-5.0, -0.04, 5.0)
    plate = scene.substrate
    assert (plate.back_reflections, plate.back_collected, plate.plate_mm) == (3, 0.4, 1.0)
    pl.write_recipe(scene, tmp_path / "again.toml")
    again = pl.read_recipe(tmp_path / "again.toml").scene()
    assert recipe_text(again, tmp_path) == recipe_text(scene, tmp_path)
    np.testing.assert_array_equal(complex_index(again.substrate.material), complex_index(plate.material))


def test_fitted_back_reflections_become_their_share(recipe_of):
    back = (line("# Back Reflections", 0.54, True, 0.0, 5.0), line("% 1st Reflection", 100.0))
    share = recipe_of(WAFER, FILM, back=back).scene().substrate.back_collected
    assert (share.lower, share.upper) == (0.0, 1.0)


def test_a_table_has_the_numbers_that_were_packed(write, refuses):
    path = write(model(WAFER, FILM), "film.mod")
    wafer = pl.material(f"{path}#SI_JAW")
    np.testing.assert_allclose(complex_index(wafer, np.array(ANGSTROMS) / 10), SILICON, rtol=1e-6)
    assert wafer.name == "SI_JAW"
    refuses(
        DataError,
        r"film.mod: has no table of a medium 'Film'; its tables: SI_JAW",
        pl.material,
        f"{path}#Film",
    )


def test_cauchy_with_its_edge(recipe_of):
    """In µm, with k = amplitude exp(exponent (E - E of the edge))."""
    film = recipe_of(WAFER, (THICK, cauchy("Film", *CAUCHY, *EDGE, edge=4000.0))).scene().layers[0].material
    um = WAVELENGTH / 1000
    k = 1.3e-2 * np.exp(1.5 * (ENERGY - 1239.841984 / 400.0))
    np.testing.assert_allclose(
        complex_index(film), 1.48 - 0.0047 / um**2 + 1.2e-5 / um**4 + 1j * k, rtol=1e-12
    )


def test_oscillators(recipe_of):
    """Lorentz by its height, Drude by resistivity and time (ε₀ and ħ of CODATA), poles; one is turned off."""
    medium = oscillators(
        "Gen-Osc", line("Einf", 1.7), LORENTZ, DRUDE, MOTT, poles=(200.0, 11.0, 0.04), used="TTF"
    )
    found = recipe_of(WAFER, (THICK, medium)).scene().layers[0].material
    expected = 1.7 + 3.0 * 0.4 * 4.1 / (4.1**2 - ENERGY**2 - 0.4j * ENERGY)
    hbar, time, siemens = 6.582119569e-16, 6e-15, 1 / (8.8541878128e-12 * 5e-6)
    expected = expected - hbar**2 * siemens / (time * ENERGY**2 + 1j * hbar * ENERGY)
    expected = expected + 200.0 / (11.0**2 - ENERGY**2) - 0.04 / ENERGY**2
    np.testing.assert_allclose(complex_index(found) ** 2, expected, rtol=1e-12)
    lorentz, drude = found.terms[:2]
    free = [isinstance(x, pl.Free) for x in (lorentz.A, lorentz.E0, lorentz.gamma, drude.Ep, drude.gamma)]
    assert free == [True, True, False, True, False]


def test_tauc_lorentz(recipe_of):
    found = recipe_of(WAFER, (THICK, oscillators("a", line("Einf", 1.0), MOTT))).scene().layers[0].material
    energy = np.array([3.2, 3.9, 5.0])
    above = np.where(energy > 3.4, 99.0 * 4.1 * 0.7 * (energy - 3.4) ** 2, 0.0)
    loss = above / ((energy**2 - 4.1**2) ** 2 + 0.7**2 * energy**2) / energy
    index = complex_index(found, 1239.841984 / energy)
    np.testing.assert_allclose((index**2).imag, loss, rtol=1e-12, atol=1e-15)


def test_a_snapshot_contains_the_model(tmp_path, recipe_of):
    with zipfile.ZipFile(tmp_path / "film.SEsnap", "w") as packed:
        packed.writestr("_FitLog", "of a fit\r\n" + model(WAFER, FILM))
    scene = pl.read_recipe(tmp_path / "film.SEsnap").scene()
    wafer = scene.substrate.material if hasattr(scene.substrate, "material") else scene.substrate
    np.testing.assert_allclose(complex_index(wafer, np.array(ANGSTROMS) / 10), SILICON, rtol=1e-6)


OFF = "turn it off, or write a recipe"
REFUSED = {
    f"has the option ParmCoupling, which is not read: {OFF}": model(
        WAFER, FILM, more=block("ParmCoupling", "2")
    ),
    f"has the option Smear Width, which is not read: {OFF}": model(
        WAFER, FILM, more=[line("Smear Width", 1.0)]
    ),
    "has the model calculation 'Include Bandwidth'": model(WAFER, FILM, calculation="Include Bandwidth"),
    "has the oscillator PSemi-M0, which is not read": model(
        WAFER, (THICK, oscillators("b", line("Einf", 1.0), ("PSemi-M0", GAP, False)))
    ),
    "layer b: has an option of Grade Parms": model(
        WAFER, (THICK, oscillators("b", line("Einf", 1.0), MOTT, grade="T"))
    ),
    "layer b: is of the kind BSPLINE, which is not read: save its n and k": model(
        WAFER, (THICK, ["'Layer'\t'b'\t'BSPLINE'\t''\t'b'"])
    ),
    "Layer1 is of the kind 'EASEGradedLayer'": model(WAFER, (THICK, ["'EASEGradedLayer'\t'b'"])),
    "layer Film: its numbers are incomplete": model(WAFER, (THICK, cauchy("Film", *CAUCHY))),
    "is a bare substrate": model(WAFER),
    "that is cut off; save it again": model(WAFER, FILM)[:-40],
    "has 2 models of CompleteEASE": 2 * (model(WAFER, FILM) + "\r\n"),
}


@pytest.mark.parametrize("said", REFUSED)
def test_refused_by_name(said, write, refusal):
    refusal(lambda path: pl.read_recipe(path).scene(), write(REFUSED[said], "film.mod"), DataError, said)


def test_a_damaged_table(write, refusal):
    text = model(WAFER, FILM).replace(array((SILICON**2).real), "'H4sIAAAA'")
    read = lambda path: pl.read_recipe(path).scene()  # noqa: E731
    refusal(read, write(text, "film.mod"), DataError, "the table of SI_JAW is damaged")
