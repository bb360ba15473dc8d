"""Recipes of Regress Pro: their formulas in complex numbers with E = 1240 / λ, what is fitted, refusals."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pellicle as pl
from pellicle.dispersion.base import known_index
from pellicle.errors import DataError
from pellicle.scene.free import insert, start_values

WAVELENGTH = np.array([240.0, 410.0, 633.0, 900.0])
ENERGY = 1240.0 / WAVELENGTH
AIR = 'cauchy "vacuum"\n 1 0 0\n 0 0 0\n'
HARMONIC = ((190.0, 10.5, 4.6, 0.3333, -0.18), (0.7, 3.3, 1.9, 0.3333, -6.8), (-0.27, 2.0, 0.8, 0.25, 1.2))
NITRIDE = 'ho "Nitride, 1" annotation "of 1 May"\n range 190 780\n 3\n'
NITRIDE += "".join("{:g} {:g} {:g} {:g} {:g}\n".format(*x) for x in HARMONIC)
POINTS = np.array(
    [[235, 2.33, 2.71], [300, 2.96, 2.15], [450, 3.09, 1.85], [700, 2.65, 1.54], [990, 2.1, 1.52]]
)
METAL = 'table "met \\"1"\n 5\n 5 3\n' + "".join("{:g} {:g} {:g}\n".format(*x) for x in POINTS)
PEAK = 'tauc-lorentz "SiN" 1 1 1.1 2.5\n 3.5 8.2 8.4\n'
BY_WIDTH = 'lorentz "x" 0 1.2 1\n 2.2 8.4 0.6\n'


def stack(*media, sizes="1600 105", fitted=("thickness 1",), seeds=("range 1500 400",), more=""):
    text = f'stack {len(media) + 2}\n {sizes}\n {AIR}{"".join(media)}library "silicon-1"\n'
    text += "fit-config\n max-iterations 30\n wavelength-range 235 780\n"
    text += "\n".join([f"fit-parameters {len(fitted)}", *fitted, f"seed-list {len(seeds)}", *seeds, more])
    return text


@pytest.fixture
def scene_of(write):
    return lambda text: pl.read_recipe(write(text, "film.rcp")).scene()


def complex_index(medium, wavelength=WAVELENGTH):
    value = known_index(insert(medium, start_values(medium)), wavelength)
    return value if isinstance(value, np.ndarray) else value.re + 1j * value.im


def harmonic(energy):
    """n − ik as Regress Pro computes it: a positive imaginary part counts as 0."""
    shares = [
        1.3788623090164978 * n * np.exp(-1j * phase) / (e * e - energy**2 + 1j * width * energy)
        for n, e, width, _, phase in HARMONIC
    ]
    field = sum(nu * share for (*_, nu, _), share in zip(HARMONIC, shares, strict=True))
    index = np.sqrt(1 + sum(shares) / (1 - field))
    return np.where(index.imag > 0, index.real, np.conj(index))


def test_layers_and_what_is_fitted(write):
    recipe = pl.read_recipe(
        write(
            stack(
                *(NITRIDE, 'library "sio2"\n'),
                fitted=("thickness 1", "n 1 ho 0", "n 1 ho 7", "thickness 2"),
                seeds=("range 1500 400", "undef", "value 2.1", "undef"),
            ),
            "film.rcp",
        )
    )
    scene = recipe.scene()
    assert [x.name for x in scene.layers] == ["Nitride_1", "sio2"]
    sizes = [x.thickness for x in scene.layers]
    assert [(x.lower, x.start, x.upper) for x in sizes] == [(110.0, 150.0, 190.0), (0.0, 10.5, 100.0)]
    film = scene.layers[0].material
    assert [isinstance(x, pl.Free) for x in film.N] == [True, False, False]
    assert [isinstance(x, pl.Free) for x in film.gamma] == [False, True, False]
    assert list(recipe.tables.data.range) == [235.0, 780.0]


def test_harmonic_oscillators(scene_of):
    film = scene_of(stack(NITRIDE, sizes="1600")).layers[0].material
    expected = harmonic(ENERGY)
    assert np.any(expected.imag == 0)
    assert np.any(expected.imag > 0.1)
    np.testing.assert_allclose(complex_index(film), expected, rtol=1e-12)


def test_a_peak_of_tauc_and_lorentz(scene_of):
    """ε₂ of the form with the place b and the width c of the peak of height a."""
    scene = scene_of(stack(PEAK, sizes="300", fitted=["n 1 tauc-lorentz 3"], seeds=["undef"]))
    term = scene.layers[0].material.terms[0]
    assert [isinstance(getattr(term, x), pl.Free) for x in ("A", "E0", "C", "Eg")] == [
        True,
        True,
        True,
        False,
    ]
    energy = np.array([2.4, 4.0, 8.0])
    above = np.maximum(energy - 2.5, 0) ** 2 / energy
    expected = 3.5 * above / (1 + 4 * ((energy**2 - 8.2**2) / 8.4**2) ** 2)
    index = complex_index(scene.layers[0].material, 1240.0 / energy)
    np.testing.assert_allclose((index**2).imag, expected, rtol=1e-12, atol=1e-14)


def test_lorentz_by_width(scene_of):
    film = scene_of(stack(BY_WIDTH, sizes="300")).layers[0].material
    energy = 1239.852 / WAVELENGTH
    expected = 1.2 + 2.2 * 8.4 * 0.6 / (8.4**2 - energy**2 - 0.6j * energy)
    np.testing.assert_allclose(complex_index(film) ** 2, expected, rtol=1e-12)


def test_a_table_has_natural_cubic_splines(write, scene_of, refuses):
    film = scene_of(stack(METAL, sizes="300")).layers[0].material
    nm, n, k = POINTS.T
    exact = [CubicSpline(nm, x, bc_type="natural") for x in (n, k)]
    at = np.array([240.0, 300.0, 512.0, 700.0])
    np.testing.assert_allclose(complex_index(film, at), exact[0](at) + 1j * exact[1](at), rtol=1e-12)
    path = write(stack(METAL, sizes="300"), "film.rcp")
    refuses(DataError, "has no table of a medium 'x'; its tables: met", pl.material, f"{path}#x")


REFUSED = {
    "layer 1: is the library 'geo2-1', whose numbers are not read: write it in a recipe": stack(
        'library "geo2-1"\n', sizes="30"
    ),
    "layer 1: is the lookup 'Poly', whose numbers are not read": stack('lookup "Poly" 1 0\n', sizes="30"),
    "layer 1: has k in a Cauchy model": stack('cauchy "x" 1.5 0 0 0.1 0 0\n', sizes="30"),
    "is of several samples: write them as [[sample]]": stack(
        NITRIDE, sizes="30", more="multi-sample\n fit-parameters 1\n thickness 1\n"
    ),
    "layer 1: line 9: expected a number, found 'x'": stack(NITRIDE.replace("4.6", "x"), sizes="30"),
    "ends where a number is expected": stack(NITRIDE, sizes="30").partition("10.5")[0],
    "layer rmult: fits rmult, which is not read: fix it": stack(NITRIDE, sizes="30", fitted=["rmult"]),
    "layer 1: fits n 1 lookup 0": stack(NITRIDE, sizes="30", fitted=["n 1 lookup 0"]),
    "has other seeds than fitted numbers": stack(NITRIDE, sizes="30", seeds=()),
    "has 2 media": stack(sizes=""),
}


@pytest.mark.parametrize("said", REFUSED)
def test_refused_by_name(said, write, refusal):
    refusal(lambda path: pl.read_recipe(path).scene(), write(REFUSED[said], "film.rcp"), DataError, said)
