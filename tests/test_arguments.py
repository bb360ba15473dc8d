"""Wrong Python arguments: one sentence that names the argument and the remedy.

They are tried in a process of their own, without the type checks of the other tests, as users do.
"""

import json
import subprocess
import sys

import pytest

CASES = {
    "pl.Spectrum(nm, np.full(3, 30.0), 'R')": ("DataError", "`values`", "divide percent by 100"),
    "pl.fit(pl.Spectrum(nm / 1000, nm / 1000, 'R'), scene)": (
        "DataError",
        "`wavelength`",
        "multiply µm by 1000",
    ),
    "pl.Spectrum('oxide.csv', nm / 1000, 'R')": ("UsageError", "`wavelength`", "pl.read_spectrum"),
    "pl.fit('oxide.csv', scene)": ("UsageError", "`data`", "pl.read_spectrum('oxide.csv')"),
    "pl.fit(Path('oxide.csv'), scene)": ("UsageError", "`data`", "pl.read_spectrum('oxide.csv')"),
    "pl.fit(['a.csv', 'b.csv'], scene)": ("UsageError", "`data`", "pl.read_spectrum('a.csv')"),
    "pl.sample('oxide.csv', scene)": ("UsageError", "`data`", "pl.read_spectrum"),
    "pl.compare('oxide.csv', {'a': scene})": ("UsageError", "`data`", "pl.read_spectrum"),
    "pl.fit([0.1, 0.2, 0.3], scene)": ("UsageError", "`data`", "pl.Spectrum(wavelength, values"),
    "pl.fit(nm, scene)": ("UsageError", "`data`", "pl.Spectrum(wavelength, values"),
    "pl.fit(scene, spectrum)": ("UsageError", "`data`", "pl.fit(data, scene)"),
    "pl.fit(spectrum, 'oxide.toml')": ("UsageError", "`scene`", "pl.read_recipe('oxide.toml').scene()"),
    "pl.fit(spectrum, layer)": ("UsageError", "`scene`", "pl.Scene(layer, 'Si')"),
    "pl.plan('oxide.toml')": ("UsageError", "`scene`", "pl.read_recipe"),
    "pl.cost('oxide.toml')": ("UsageError", "`scene`", "pl.read_recipe"),
    "pl.simulate(layer)": ("UsageError", "`scene`", "pl.Scene(layer, 'Si')"),
    "pl.simulate(scene, nm, noise=-1)": ("UsageError", "`noise`", "negative"),
    "pl.compare(spectrum, [scene, scene])": ("UsageError", "`scenes`", "names"),
    "pl.Layer('cauchy', 100.0)": ("UnknownMaterial", "dispersion model", "pl.dispersion.Cauchy"),
    "pl.Layer(scene, 100.0)": ("UsageError", "a medium is", "not Scene"),
    "pl.Layer([1.4, 1.5], 100.0)": ("UsageError", "a medium is", "not list"),
    "pl.Layer(pl.dispersion.Lorentz(1, 4, 0.1), 9.0)": ("UsageError", "a medium", "Oscillators(1.0, ("),
    "pl.Layer('SiO2', '100')": ("UsageError", "`thickness`", "pl.Free(lower, upper)"),
    "pl.Layer('SiO2', (10, 100))": ("UsageError", "`thickness`", "pl.Free(lower, upper)"),
    "pl.Layer('SiO2', None)": ("UsageError", "`thickness`", "missing"),
    "pl.Layer('SiO2', 1e300)": ("UsageError", "`thickness`", "a metre"),
    "pl.Layer('SiO2', pl.Free(1, 1e300))": ("UsageError", "`thickness`", "a metre"),
    "pl.Scene('SiO2', 'Si')": ("UsageError", "layer", "pl.Layer('SiO2', 100.0)"),
    "pl.Scene(layer, pl.Layer('Si', 1.0))": ("UsageError", "a medium is", "not Layer"),
    "pl.Free(100, 10)": ("ValueError", "reversed", "lower 100 is not below upper 10"),
    "pl.Free('10', 100)": ("UsageError", "`lower`", "'10'"),
    "pl.Light(angle='70')": ("UsageError", "`angle`", "'70'"),
    "pl.Instrument(bandwidth='2')": ("UsageError", "`bandwidth`", "'2'"),
    "pl.material(1.5)": ("UsageError", "a material is a name", "pl.medium"),
    "pl.medium(None)": ("UsageError", "a medium is", "not NoneType"),
    "pl.reflectance(500e-9, 100.0, 'SiO2', 'Si')": ("UsageError", "like one in m:", "write 500"),
    "pl.reflectance(0.5, 100.0, 'SiO2', 'Si')": ("UsageError", "like one in µm:", "write 500"),
    "pl.reflectance(500.0, '100', 'SiO2', 'Si')": ("UsageError", "`thickness`", "'100'"),
}

TRY = """
import json, sys
from pathlib import Path
import numpy as np
import pellicle as pl

nm = np.array([400.0, 500.0, 600.0])
layer = pl.Layer("SiO2", pl.Free(10, 1000))
scene = pl.Scene(layer, "Si")
spectrum = pl.Spectrum(nm, nm / 1000, "R")
found = {}
for case in json.load(sys.stdin):
    try:
        found[case] = ["nothing", repr(eval(case))]
    except Exception as error:
        found[case] = [type(error).__name__, str(error)]
found["printed"] = [repr(spectrum), repr(pl.medium(1.5))]
json.dump(found, sys.stdout)
"""


@pytest.fixture(scope="module")
def answers():
    command = [sys.executable, "-c", TRY]
    ran = subprocess.run(command, input=json.dumps([*CASES]), capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


@pytest.mark.parametrize("case", CASES)
def test_wrong_arguments(answers, case):
    kind, *words = CASES[case]
    raised, message = answers[case]
    assert raised == kind, message
    assert [word for word in words if word not in message] == [], message
    assert "\n" not in message


def test_a_spectrum_prints_short(answers):
    assert answers["printed"][0] == "spectrum: 3 points of R, 400 to 600 nm"


def test_a_number_is_a_medium(answers):
    assert answers["printed"][1] == "Constant(n=1.5)"
