"""Causes of misfits, found by refits without one usual mistake each; data by an independent code."""

import re

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import DataError
from pellicle.fitting.film.explanations import _Trials
from pellicle.fitting.film.mistakes import Mistake

from ...by_tmm import films, ncs, psi_delta

NM = np.linspace(420.0, 800.0, 60)
OXIDE, SILICON, GLASS = (np.asarray(pl.refractive_index(NM, name)) for name in ("SiO2", "Si", "BK7"))
DEPTH, NOISE = 320.0, 5e-4


def reflectance(angle=60.0, substrate=SILICON, depth=DEPTH):
    return films("s", NM, [1.0, OXIDE, substrate], [depth], angle)


def spectrum(values, seed=0):
    noisy = values + np.random.default_rng(seed).normal(0, NOISE, NM.size)
    return pl.Spectrum(NM, noisy, "R", polarisation="s", angle=np.full(NM.size, 60.0))


SCENE = pl.Scene(pl.Layer("SiO2", pl.Free(100, 600)), "Si", light=pl.Light(polarisation="s"))
BARE = films("s", NM, [1.0, SILICON], [], 60.0)


@pytest.mark.slow  # twenty searches each
@pytest.mark.parametrize(
    ("values", "cause", "remedy"),
    [
        (
            reflectance(63.0),
            r"with an angle of incidence that is \+[23]\.?\d* degrees off",
            "`angle_shift = ",
        ),
        (reflectance() / BARE, "with values relative to bare Si", 'substrate = "Si"'),
        (0.01 * reflectance(), "with values times 100", 'signal_unit="fraction"'),
        (reflectance() + 0.05, r"with an offset of 0\.0[45]\d*", '`offset="free"`'),
        (reflectance(substrate=GLASS), "with BK7 as the substrate", 'substrate="BK7"'),
    ],
)
def test_a_refusal_names_its_cause_and_the_thickness_without_it(values, cause, remedy):
    fit = pl.fit(spectrum(values), SCENE)
    assert fit.status == "misfit"
    assert re.match(f"{cause} it would fit, with thickness", fit.warnings[0])
    assert remedy in fit.warnings[0]
    assert float(re.findall(r"thickness ([\d.]+)", fit.warnings[0])[0]) == pytest.approx(DEPTH, rel=3e-3)
    assert not any("would explain" in warning for warning in fit.warnings)


@pytest.mark.slow  # twenty searches, and programs of three more scenes
def test_a_rough_surface_is_named_for_psi_and_delta():
    """Ten layers in which a film gives way to air, mixed by Maxwell Garnett's rule: 20 nm in all."""
    share = (np.arange(10) + 0.5) / 10
    fall = (1.65**2 - 1) / (1.65**2 + 2)
    mixed = [np.sqrt((1 + 2 * f * fall) / (1 - f * fall)) for f in share]
    angle, random = 65.0, np.random.default_rng(3)
    stack = [1.0, *mixed, 1.65, SILICON], [*np.full(10, 2.0), 690.0]
    values = [x + random.normal(0, 0.01, NM.size) for x in psi_delta(*ncs(NM, *stack, angle).T)]
    data = pl.Spectrum(NM, values[0], "psi-delta", delta=values[1], angle=np.full(NM.size, angle))
    fit = pl.fit(data, pl.Scene(pl.Layer(1.65, pl.Free(100, 900)), "Si"))
    assert fit.status == "misfit"
    said = re.match(
        r"with ([\d.]+) nm of rough surface it would fit, with layer2.thickness ([\d.]+)", fit.warnings[0]
    )
    assert said
    rough, depth = (float(x) for x in said.groups())
    assert 8 < rough < 20
    assert depth + rough / 2 == pytest.approx(700.0, abs=1.0)


@pytest.mark.slow  # twenty searches
def test_a_misfit_of_a_free_film_has_no_reference_of_air():
    """An oxide on silicon that is fitted as a film in air, of which no reflectance is a share."""
    fit = pl.fit(spectrum(reflectance()), pl.Scene(SCENE.layers, "air", light=SCENE.light))
    assert fit.status == "misfit"
    assert not any("relative to bare air" in warning for warning in fit.warnings)


@pytest.mark.slow  # two fits of one program
def test_files_of_other_spots_are_told_apart():
    data = [spectrum(reflectance(depth=300.0)), spectrum(reflectance(depth=330.0), seed=1)]
    fit = pl.fit(data, [SCENE, SCENE])
    assert fit.status == "misfit"
    [said] = [warning for warning in fit.warnings if warning.startswith("the files disagree")]
    depths = [float(x) for x in re.findall(r"alone gives ([\d.]+) nm", said)]
    assert depths == pytest.approx([300.0, 330.0], rel=3e-3)


def test_a_number_is_sought_where_the_media_are_known(monkeypatch):
    """Shifted wavelengths may pass the end of a table: the least misfit of those that do not is taken."""

    def searched(self, trial, thorough, compiled=False):
        if abs(trial.value) > 9:
            raise DataError("SU-8 is known from 320 to 1450 nm")
        return trial._replace(deviance=(trial.value - 3.3) ** 2)

    monkeypatch.setattr(_Trials, "_searched", searched)
    mistake = Mistake("{} nm off", "", (), lambda target, _: target, np.linspace(-16, 16, 9))
    trials = object.__new__(_Trials)
    trials.data = spectrum(OXIDE.real)
    assert abs(trials._best(mistake, []) - 3.3) < 1e-6
