"""Recipes: every form that the contract allows, uncertainties too, and one telling sentence for others."""

from dataclasses import fields

import numpy as np
import pytest

from pellicle.dispersion.empirical import Cauchy
from pellicle.scene.free import Free
from pellicle.scene.instrument import Drift
from pellicle.scene.uncertainty import Uncertainty

AT = np.array([500.0, 700.0])
LAYER = '[[scene.layer]]\nmaterial = "SiO2"\nthickness = { lower = 10, upper = 3000 }\n'
BASE = f'[scene]\nsubstrate = "Si"\n{LAYER}'


def test_the_contracts_recipe(read):
    """All of DESIGN's example that exists by now."""
    recipe = read(
        """
        [data]
        files = ["quartz.csv", "deep/../oxide.csv"]
        signal = "R"
        angle = 20.0
        polarisation = "s"
        noise = 0.005
        range = [400, 900]
        wavelengths = { start = 380, stop = 780, step = 2 }
        joint = false
        [scene]
        ambient = "air"
        substrate = { material = "SiO2", back = "air", plate_mm = 0.5 }
        [[scene.layer]]
        name = "oxide"
        material = { model = "cauchy", A = { value = 1.45, lower = 1.3, upper = 1.7 }, B = 3000.0 }
        thickness = { lower = 10, upper = 3000 }
        [instrument]
        scale = "slow"
        offset = "free"
        bandwidth = { lower = 0, upper = 20 }
        thickness_spread = 1.5
        """
    )
    data, scene = recipe.tables.data, recipe.scene()
    assert (data.noise, data.range, data.joint) == (0.005, (400, 900), False)
    assert (scene.light.signal, scene.light.angle, scene.light.polarisation) == ("R", 20, "s")
    assert scene.substrate.plate_mm == 0.5
    np.testing.assert_allclose(scene.substrate.back(AT), 1)
    layer = scene.layers[0]
    assert layer.name == "oxide"
    assert isinstance(layer.material, Cauchy)
    assert (layer.material.A.start, layer.material.A.lower, layer.material.A.upper) == (1.45, 1.3, 1.7)
    assert (layer.material.B, layer.material.C) == (3000, 0)
    assert (layer.thickness.start, layer.thickness.lower, layer.thickness.upper) == (1505, 10, 3000)
    assert scene.instrument.scale == Drift(3)
    assert scene.instrument.offset == Drift(0)
    assert scene.instrument.bandwidth.upper == 20
    assert scene.instrument.thickness_spread == 1.5


def test_defaults(read):
    recipe = read(BASE)
    scene = recipe.scene()
    assert recipe.files == []
    assert (scene.instrument.scale, scene.instrument.offset) == (1, 0)
    assert scene.instrument.bandwidth is None
    assert scene.substrate.back is None
    assert (scene.light.signal, scene.light.angle) == ("R", 0)
    np.testing.assert_allclose(scene.ambient(AT), 1)


def test_files_are_relative_to_the_recipe(read, tmp_path):
    recipe = read('[data]\nfiles = ["a.csv", "../b.csv"]\n' + BASE)
    assert recipe.files == [str(tmp_path / "a.csv"), str(tmp_path.parent / "b.csv")]


def test_tables_are_relative_to_the_recipe(scene, tmp_path):
    (tmp_path / "resin.csv").write_text("wavelength_nm,n,k\n400,1.6,0.1\n900,1.6,0.1\n")
    found = scene(BASE.replace('"SiO2"', '"resin.csv"'))
    np.testing.assert_allclose(found.layers[0].material(AT), 1.6 + 0.1j)


def test_a_thickness_may_be_a_number_or_a_value(scene):
    thickness = lambda text: scene(BASE.replace("{ lower = 10, upper = 3000 }", text)).layers[0].thickness  # noqa: E731
    assert thickness("120") == 120
    assert thickness("{ value = 120 }") == 120
    free = thickness("{ value = 120, lower = 10, upper = 300, prior = { mean = 100, sd = 5 } }")
    assert isinstance(free, Free)
    assert (free.start, free.lower, free.upper) == (120, 10, 300)
    assert (free.prior.mean, free.prior.sd) == (100, 5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[dat]\n" + BASE, ("'dat'", "'data'")),
        ("[data]\nfilles = ['a.csv']\n" + BASE, ("'data.filles'", "'files'")),
        (BASE.replace("upper", "uper"), ("uper", "'upper'")),
        ("[data]\nwavelengths = { start = 1, stop = 2, stepp = 1 }\n" + BASE, ("stepp", "'step'")),
    ],
)
def test_an_unknown_key_names_the_nearest(refused, text, said):
    refused(text, "unknown key", *said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[data]\nsignal = 'X'\n" + BASE, ("data.signal", "'X'")),
        ("[data]\nspot = 0\n" + BASE, ("data.spot: ",)),
        ("[data]\nanalyser = 90\n" + BASE, ("data.analyser: ",)),
        ("[data]\nwavelength_unit = 'mm'\n" + BASE, ("data.wavelength_unit: must be one of nm, um", "'mm'")),
        ("[data]\nsignal_unit = 'ppm'\n" + BASE, ("data.signal_unit: must be one of fraction", "'ppm'")),
        ("[data]\nnoise = 0\n" + BASE, ("data.noise", "greater than 0")),
        (BASE.replace("{ lower = 10, upper = 3000 }", "'thick'"), ("thickness", "'thick'")),
        (BASE.replace("lower = 10", "lower = -10"), ("thickness", "-10")),
        (BASE.replace("lower = 10", "lower = 5000"), ("thickness", "reversed")),
        (BASE.replace("lower = 10, ", ""), ("thickness", "lower and upper")),
        (BASE.replace("lower = 10", "value = 5, lower = 10"), ("thickness", "start value 5")),
        (BASE.replace('"SiO2"', '"SiO3"'), ("SiO3", "SiO2")),
        (BASE.replace('"SiO2"', '{ model = "cauchi" }'), ("cauchi", "'cauchy'")),
        (BASE.replace('"SiO2"', '{ model = "cauchy", D = 3 }'), ("'D'", "A, B, C")),
        (BASE.replace('"SiO2"', '{ model = "cauchy", A = "high" }'), ("A must be", "'high'")),
        (BASE.replace('"SiO2"', "-1.5"), ("-1.5",)),
        (BASE.replace('"SiO2"', '"gone.csv"'), ("gone.csv",)),
        (BASE + "[instrument]\nscale = 'loose'\n", ("instrument.scale", "'loose'")),
        (BASE + "[instrument]\nscale = { varies = 'slow' }\n", ("instrument.scale", "varies", "'slow'")),
        ('[scene]\nsubstrate = "Si"\nlayer = []\n', ("scene.layer",)),
        ("[data]\nfile = ['a.csv']\n" + BASE, ("data.file", "go into files")),
        ("[data]\nwavelengths = [400, nan]\n" + BASE, ("data.wavelengths.1", "finite", "nan")),
        (BASE.replace('"SiO2"', "inf"), ("scene.layer.0.material", "finite", "inf")),
        (BASE.replace('"SiO2"', "{ model = 'cody-lorentz', E0 = 2, Eg = 3 }"), ("below", "Eg 3 and E0 2")),
        (BASE + "[instrument]\nbandwidth = -1\n", ("bandwidth", "-1")),
        (BASE.replace('"SiO2"', "{ model = 'tauc-lorentz', A = nan }"), ("A must be a finite number",)),
        (BASE.replace('"SiO2"', "{ model = 'spline', knots = [400, nan, 700] }"), ("knots2", "finite")),
        (BASE.replace("upper = 3000", "upper = 1e300"), ("thickness", "a metre", "1e+300")),
        (BASE.replace("upper = 3000", "upper = inf"), ("thickness", "two finite bounds")),
        (BASE.replace("3000 }", "3000, prior = { mean = nan, sd = 1 } }"), ("prior.mean", "finite")),
        (BASE + "[instrument]\nbandwidth = inf\n", ("instrument.bandwidth", "finite", "inf")),
    ],
)
def test_refused_in_one_sentence(refused, text, said):
    refused(text, *said)


def test_missing_keys(refused):
    refused("", "scene is missing")
    refused(LAYER, "scene.substrate is missing")
    refused('[scene]\nsubstrate = "Si"\n', "scene.layer is missing")
    refused(BASE.replace('material = "SiO2"\n', ""), "scene.layer.0: a layer has a material, or between")


@pytest.mark.parametrize(
    ("layer", "said"),
    [
        ("thickness = 5", 'a layer has a material, or between = "bruggeman"'),
        ('material = 1.5\nbetween = "bruggeman"\nthickness = 5', "a layer has a material, or between"),
        ("material = 1.5", "a thickness in nm, or plate_mm"),
        ("material = 1.5\nthickness = 5\nplate_mm = 1", "a thickness in nm, or plate_mm"),
        ("material = 1.5\nthickness = 5\nsteps = 3", "steps does not go with a coherent layer"),
        ("material = 1.5\nplate_mm = 1\nroughness = 3", "roughness does not go with plate_mm"),
        ('between = "brugeman"\nthickness = 5', "no mix 'brugeman'"),
        ('between = "linear"\nthickness = 5\nsteps = 0', "1 to 100 steps"),
    ],
)
def test_layers_that_make_no_sense(refused, layer, said):
    refused(f'[scene]\nsubstrate = "Si"\n[[scene.layer]]\n{layer}\n', said)


def test_a_file_has_its_own_words(tmp_path, read):
    """What a file does not say is that of the recipe; `back = false` makes the plate a half space."""
    found = read(
        "[data]\nangle = 10.0\nnoise = 0.01\n[[data.file]]\npath = 'r.csv'\n"
        "[[data.file]]\npath = 'e.csv'\nsignal = 'psi-delta'\nangle = 70.0\nback = false\n"
        "instrument = { bandwidth = 2.0, scale = 1.0 }\n"
        "[scene]\nsubstrate = { material = 'SiO2', back = 'air', plate_mm = 2.0 }\n"
        "[[scene.layer]]\nmaterial = 1.46\nthickness = 10\n[instrument]\nscale = 'free'\nbandwidth = 3.0\n"
    )
    assert found.files == [str(tmp_path / name) for name in ("r.csv", "e.csv")]
    first, second = found.each
    assert (first.tables.data.angle, second.tables.data.angle) == (10.0, 70.0)
    assert (first.tables.data.noise, second.tables.data.noise) == (0.01, 0.01)
    assert (first.tables.instrument.scale, second.tables.instrument.scale) == ("free", 1.0)
    assert (first.scene().instrument.bandwidth, second.scene().instrument.bandwidth) == (3.0, 2.0)
    assert first.scene().substrate.back is not None
    assert second.scene().substrate.back is None
    assert second.scene().substrate.plate_mm == 2.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("files = ['b.csv']\n[[data.file]]\npath = 'a.csv'", "exclude each other"),
        ("[[data.file]]\npath = 'a.csv'\nnoize = 1", "did you mean 'noise'"),
        ("[[data.file]]\nsignal = 'R'", "data.file.0.path is missing"),
        ("[[data.file]]\npath = 'a.csv'\ninstrument = { scal = 1 }", "scale"),
    ],
)
def test_bad_words_of_a_file(refused, words, said):
    refused(f"[data]\n{words}\n{BASE}", said)


def test_calibration_errors_as_parameters(scene, refused):
    """The angle of incidence and the wavelengths of an instrument that is off."""
    end = f"{BASE}[instrument]\nwavelength_shift = {{ lower = -2, upper = 2 }}\n"
    head = "[data]\nsignal = 'psi-delta'\nangle = "
    found = scene(f"{head}{{ lower = 69, upper = 71 }}\n{end}")
    assert (found.light.angle.lower, found.light.angle.upper) == (69, 71)
    assert found.instrument.wavelength_shift.start == 0
    refused(f"{head}{{ lower = 69, upper = 91 }}\n{end}", "must lie in 0 to 90 degrees, got 91")
    refused(f"{head}91\n{end}", "angle")


MATERIAL = 'material = "SiO2"\n'
SAMPLE = ["index", "dispersion", "roughness", "thickness_spread", "interlayer", "overlayer"]
INSTRUMENT = [field.name for field in fields(Uncertainty) if field.name not in SAMPLE]


@pytest.mark.parametrize("name", INSTRUMENT + SAMPLE)
def test_an_uncertainty_replaces_the_usual_one(scene, name):
    """All others stay usual, or none."""
    line = f"{name}_uncertainty = 0.25\n"
    if name in INSTRUMENT:
        text = BASE + "[instrument]\n" + line
    else:
        text = BASE.replace("[scene]\n", "[scene]\n" + line)
    assert scene(text).uncertainty == Uncertainty(**{name: 0.25})
    nothing = text.replace("[scene]\n", '[scene]\nuncertainty = "none"\n')
    usual = dict.fromkeys(INSTRUMENT + SAMPLE, 0.0)
    assert scene(nothing).uncertainty == Uncertainty(**usual | {name: 0.25})


def test_uncertainties_of_a_layer_and_the_substrate(scene):
    text = BASE.replace('"Si"', '{ material = "Si", index_uncertainty = 0.001 }')
    found = scene(text + "index_uncertainty = 0\n")
    assert (found.layers[0].index_uncertainty, found.substrate.index_uncertainty) == (0, 0.001)
    plain = scene(BASE)
    assert plain.uncertainty == Uncertainty()
    assert (plain.layers[0].index_uncertainty, plain.substrate.index_uncertainty) == (None, None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BASE + "[instrument]\nscale_uncertainty = -0.1\n", ("instrument.scale_uncertainty", "0")),
        (BASE + "[instrument]\nscale_uncertainty = 'low'\n", ("instrument.scale_uncertainty", "'low'")),
        (BASE + "[instrument]\nindex_uncertainty = 0.1\n", ("instrument.index_uncertainty",)),
        (BASE + "index_uncertainty = -1\n", ("index_uncertainty", "0")),
        (BASE.replace("[scene]\n", '[scene]\nuncertainty = "some"\n'), ("scene.uncertainty", "'some'")),
        (BASE.replace(MATERIAL, 'between = "linear"\nindex_uncertainty = 0.1\n'), ("not go with between",)),
    ],
)
def test_uncertainties_refused(refused, text, said):
    refused(text, *said)
