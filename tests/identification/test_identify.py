"""Identification of films that the package tmm computes, with noise, and what is refused."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.identification import identify
from pellicle.identification.free_models import CONDUCTOR, FREE_MODELS, built
from pellicle.identification.growth import grow
from pellicle.identification.hypothesis import Outcome
from pellicle.reporting.identification import write_identification
from tests import by_tmm

NM = np.linspace(420, 880, 120)


def index(name):
    n = pl.medium(name)(NM)
    return np.asarray(n, complex)


def reflectance(*films, substrate="Si", noise=0.002, seed=1):
    """R of films (name, thickness) from the ambient down."""
    indices = 1.0, *(index(name) for name, _ in films), index(substrate)
    values = by_tmm.films("s", NM, indices, [depth for _, depth in films])
    return pl.Spectrum(NM, values + noise * np.random.default_rng(seed).normal(size=NM.size), "R")


def test_an_oxide_is_identified_by_its_index():
    found = pl.identify(reflectance(("SiO2", 300.0)), "Si", family="oxide")
    film = found.best.layers[0]
    assert found.status is Outcome.IDENTIFIED
    assert film.like[0] == "SiO2"
    assert abs(film.thickness.value - 300) < 3 * film.thickness.stderr < 10
    assert film.thickness.stderr_noise < film.thickness.stderr
    assert found.verdict.startswith("A film of index 1.45 to 1.47, as SiO2, 30")
    assert "Excluded: " in found.verdict
    assert {"alumina", "Y2O3"} <= {x.name for x in found.excluded}
    untried = {x.material: x.why for x in found.not_tried}
    assert {"graded index", "contamination on top", "two layers"} <= set(untried)
    assert "birefringence" not in untried
    assert untried["roughness"] == "a simpler structure leaves only noise and usual errors"
    html = found._repr_html_()
    assert html.count("<tr>") == 2
    assert "<b>identified</b>: A film of index" in html
    data, residuals, evidence = found.plot().axes
    points, curve = data.lines
    assert np.abs(points.get_ydata() - curve.get_ydata()).max() < 0.02
    assert np.allclose(residuals.lines[0].get_ydata(), points.get_ydata() - curve.get_ydata())
    assert evidence.lines[1].get_ydata().tolist() == [0.0]
    assert min(evidence.lines[2].get_ydata()) > 5


def test_films_of_one_index_are_not_told_apart():
    """Yttria and nitride of 245 nm differ by 4 % in index; thickness and scale make up for it."""
    found = pl.identify(reflectance(("Si3N4", 245.0)), "Si", among=["Si3N4", "Y2O3", "SiO2"])
    assert found.status is Outcome.UNDECIDED
    assert {x.name for x in found.hypotheses} >= {"Si3N4", "Y2O3"}
    assert sum(x.probability for x in found.hypotheses) == pytest.approx(1)
    assert "do not decide" in found.verdict


def test_a_film_without_dispersion_is_never_certain():
    """No film of the catalogue is so flat; two layers, or another substrate, often look like one."""
    values = by_tmm.films("s", NM, (1.0, np.full(NM.size, 1.69 + 0j), index("Si")), [135.0])
    noise = 0.002 * np.random.default_rng(1).normal(size=NM.size)
    found = pl.identify(pl.Spectrum(NM, values + noise, "R"), "Si", among=["SiO2", "TiO2", "HfO2"], layers=1)
    assert found.status is Outcome.UNDECIDED
    thickness = found.best.layers[0].thickness
    assert abs(thickness.value - 135) < 3 * thickness.stderr < 15


@pytest.mark.slow
def test_a_wrong_angle_is_named_and_never_certain():
    """100 nm of oxide, of which Ψ and Δ were measured at 68° and stated at 70°."""
    ncs = by_tmm.ncs(NM, (1.0, index("SiO2"), index("Si")), [100.0], 68.0)
    psi = np.rad2deg(np.arctan2(np.hypot(ncs[:, 1], ncs[:, 2]), ncs[:, 0])) / 2
    delta = np.rad2deg(np.arctan2(ncs[:, 2], ncs[:, 1])) % 360
    noise = 0.03 * np.random.default_rng(1).normal(size=(2, NM.size))
    data = pl.Spectrum(NM, psi + noise[0], "psi-delta", delta=delta + noise[1], angle=np.full(NM.size, 70.0))
    found = pl.identify(data, "Si", among=["SiO2", "MgF2", "alumina"], layers=1)
    assert found.status is Outcome.UNDECIDED
    assert "angle of incidence" in found.verdict
    assert any(abs(x.layers[0].thickness.value - 100) < 2 for x in found.hypotheses)


def test_bare_silicon_has_no_film():
    found = pl.identify(reflectance(("SiO2", 2.0)), "Si", among=["SiO2", "Si3N4"])
    assert found.best.name in ("bare substrate", "native oxide")


@pytest.mark.slow
def test_a_reflectance_relative_to_silicon_is_at_most_undecided():
    spectrum = reflectance(("SiO2", 300.0), noise=0.001)
    mirror = np.abs((1 - index("Si")) / (1 + index("Si"))) ** 2
    relative = dataclasses.replace(spectrum, values=spectrum.values / mirror)
    found = pl.identify(relative, "Si", among=["SiO2", "Si3N4"], layers=1)
    assert found.status is Outcome.UNDECIDED
    assert found.best.condition == "the reflectance was measured relative to Si"
    assert "If the reflectance was measured relative to Si" in found.verdict
    alone = pl.identify(relative, "Si", among=["SiO2"], layers=1, allow=())
    assert (alone.status, alone.hypotheses) == (Outcome.NONE, ())
    assert alone.verdict.startswith("No hypothesis that was tried describes the data")


def test_only_likely_mistakes_are_grown(monkeypatch):
    """Of a reflectance relative to aluminium, one to silicon is not tried."""
    spectrum = reflectance(("SiO2", 300.0), noise=0.001)
    mirror = np.abs((1 - index("Al")) / (1 + index("Al"))) ** 2
    relative = dataclasses.replace(spectrum, values=spectrum.values / mirror)
    grown = []
    monkeypatch.setattr(identify, "grow", lambda *given: grown.append(given) or grow(*given))
    found = pl.identify(relative, "Si", among=["SiO2", "Si3N4"], layers=1)
    assert found.best.condition == "the reflectance was measured relative to Al"
    assert len(grown) == 2


def test_other_thicknesses_of_a_film_are_left():
    """Noise of 0.5 % hides the fringes of PMMA on glass, whose index differs by 0.02."""
    spectrum = reflectance(("PMMA", 120.0), substrate="BK7", noise=0.005)
    found = pl.identify(spectrum, "BK7", among=["PMMA"], layers=1)
    films = [x for x in found.hypotheses if x.name.startswith("PMMA, ")]
    assert len(films) > 1
    assert len({x.name for x in found.hypotheses}) == len(found.hypotheses)


@pytest.mark.slow
def test_a_wrong_back_face_is_at_most_undecided():
    """Light from the front face alone, stated to be that of a plate."""
    spectrum = reflectance(("CdS", 80.0), substrate="BK7")
    found = pl.identify(spectrum, "BK7", back="air", among=["CdS", "SiO2", "ZnS"], layers=1)
    assert found.status is Outcome.UNDECIDED
    assert "If no light from the back face was measured, the same layers describe the data" in found.verdict
    right = pl.identify(spectrum, "BK7", among=["CdS", "SiO2", "ZnS"], layers=1)
    assert right.status is Outcome.IDENTIFIED
    assert abs(right.best.layers[0].thickness.value - 80) < 3 * right.best.layers[0].thickness.stderr < 5


@pytest.mark.slow
def test_another_glass_is_named_and_never_certain():
    spectrum = reflectance(("Y2O3", 400.0), substrate="BK7")
    found = pl.identify(spectrum, "SF10/HOYA", among=["Y2O3", "SiO2", "ZrO2"], layers=1)
    assert found.status is Outcome.UNDECIDED
    assert found.best.condition == "the substrate is another glass, as BK7"
    assert " thick on BK7." in found.verdict
    assert found.best.layers[0].thickness.value == pytest.approx(400, abs=5)
    # gold has an index of less than 1.7
    wrong = pl.identify(spectrum, "Au", among=["Y2O3"], layers=1, allow=["substrate"])
    assert "glass" not in wrong.verdict


def test_a_glass_with_other_films_that_the_data_favour_is_named():
    """Ta2O5 on BK7 is Nb2O5 on SF10 with nearly the same evidence."""
    spectrum = reflectance(("Ta2O5", 80.0), substrate="BK7")
    tried = ["Ta2O5", "Nb2O5", "Si3N4", "TiO2"]
    found = pl.identify(spectrum, "SF10/HOYA", among=tried, layers=1)
    assert found.status is Outcome.UNDECIDED
    assert "If the substrate is another glass, as BK7, another film describes the data" in found.verdict
    assert pl.identify(spectrum, "BK7", among=tried, layers=1).status is Outcome.IDENTIFIED
    alone = pl.identify(spectrum, "SF10/HOYA", among=tried, layers=1, allow=())
    assert alone.status is Outcome.IDENTIFIED


def test_a_file_without_an_angle_is_said_where_nothing_describes_it():
    pair = [reflectance(("SiO2", 300.0)), reflectance(("SiO2", 500.0))]
    found = pl.identify(pair, "Si", among=["SiO2"], layers=1, allow=())
    assert found.status is Outcome.NONE
    assert "Spectra without an angle of incidence were compared at one" in found.verdict
    assert "--angle 8,60" in found.verdict


def test_data_beyond_most_tables_are_left_out():
    """Polystyrene is tabulated from 437 nm on; this one absorbs below 430 nm."""
    nm = np.linspace(380, 880, 120)
    film = np.asarray(pl.medium("polystyrene")(np.maximum(nm, 440)), complex)
    film = film + 0.4j * np.clip((430 - nm) / 20, 0, 1) + 0.3 * np.sin(nm / 5) * (nm < 430)
    silicon = np.asarray(pl.medium("Si")(nm), complex)
    values = by_tmm.films("s", nm, (1.0, film, silicon), [300.0])
    spectrum = pl.Spectrum(nm, values + 0.002 * np.random.default_rng(1).normal(size=nm.size), "R")
    found = pl.identify(spectrum, "Si", among=["polystyrene", "PMMA"], layers=1, allow=())
    assert found.status is Outcome.UNDECIDED
    assert found.best.condition.endswith("nm are compared, which most tables cover")
    assert "polystyrene" in found.best.layers[0].like
    assert found.best.layers[0].thickness.value == pytest.approx(300, abs=5)
    assert found.data[0].wavelength.min() > 430


def test_a_film_whose_table_ends_within_the_data_bars_a_free_index():
    """Tantala from 300 nm on, whose table begins at 350 nm, by a Cauchy index near that of the table."""
    nm = np.linspace(300, 900, 140)
    known = nm[nm > 350]
    slope, mean = np.polyfit(known**-2.0, np.real(np.asarray(pl.medium("Ta2O5")(known))), 1)
    indices = 1.0, mean + slope / nm**2 + 0j, np.asarray(pl.medium("Si")(nm), complex)
    values = by_tmm.films("s", nm, indices, [150.0])
    random = np.random.default_rng(1)
    # one R would leave an index that is like that of no film in doubt
    twice = [pl.Spectrum(nm, values + 0.002 * random.normal(size=nm.size), "R") for _ in range(2)]
    found = pl.identify(twice, "Si", among=["SiO2", "Si3N4", "Ta2O5"], layers=1)
    assert found.status is Outcome.UNDECIDED
    assert "Ta2O5 was not tried on all data, as its table goes from 350 to 1800 nm." in found.verdict
    assert abs(found.best.layers[0].thickness.value - 150) < 3 * found.best.layers[0].thickness.stderr < 10
    others = pl.identify(twice, "Si", among=["SiO2", "Si3N4", "ZnO"], layers=1)
    assert others.status is Outcome.IDENTIFIED


@pytest.fixture(scope="module")
def opaque():
    return pl.identify(reflectance(("Au", 400.0)), "Si", among=["Au", "Ag"], layers=1)


def test_the_thickness_of_an_opaque_film_is_unknown(opaque):
    assert opaque.status is Outcome.UNDECIDED
    assert {x.layers[0].material for x in opaque.hypotheses} == {"Au"}
    assert "from whose lower face no light returns: its thickness is unknown." in opaque.verdict


def test_recipes_of_an_earlier_identification_are_removed(opaque, tmp_path):
    write_identification(tmp_path / "out", opaque)
    assert (tmp_path / "out/2.toml").exists()
    own = tmp_path / "out" / f"{len(opaque.hypotheses) + 1}.toml"
    own.write_text("# of the user")
    write_identification(tmp_path / "out", dataclasses.replace(opaque, hypotheses=opaque.hypotheses[:1]))
    assert sorted(x.name for x in own.parent.glob("*.toml")) == ["1.toml", own.name]


def test_time_that_ends_is_said():
    found = pl.identify(reflectance(("TiO2", 60.0), ("SiO2", 300.0)), "Si", budget=1e-9)
    assert found.verdict.endswith("The budget of 1e-09 s ended before all was tried.")
    assert found.not_tried[-1].why == "the budget of 1e-09 s had ended"
    assert len(found.hypotheses) + len(found.excluded) < 3


@pytest.mark.slow  # compiles the program of psi and delta
def test_another_convention_of_delta_is_named():
    angle = np.full(NM.size, 70.0)
    psi, delta = by_tmm.psi_delta(*by_tmm.ncs(NM, (1.0, index("SiO2"), index("Si")), [100.0], angle).T)
    noise = 0.1 * np.random.default_rng(1).normal(size=(2, NM.size))
    spectrum = pl.Spectrum(NM, psi + noise[0], "psi-delta", delta=(180 - delta + noise[1]) % 360, angle=angle)
    found = pl.identify(spectrum, "Si", among=["SiO2", "Si3N4"], layers=1)
    assert found.status is Outcome.UNDECIDED
    assert "another convention of delta (180 - delta in place of delta)" in found.best.condition
    assert found.best.layers[0].thickness.value == pytest.approx(100, abs=3)


@pytest.mark.slow  # two layers
def test_two_layers_are_found_unasked():
    found = pl.identify(reflectance(("TiO2", 60.0), ("SiO2", 300.0)), "Si")
    upper, lower = found.best.layers
    assert "more than two layers" in {x.material for x in found.not_tried}
    assert ("TiO2" in upper.like, "SiO2" in lower.like) == (True, True)
    assert abs(upper.thickness.value - 60) < 3 * upper.thickness.stderr
    assert abs(lower.thickness.value - 300) < 3 * lower.thickness.stderr


def test_free_charges_stand_beside_dispersion():
    """An index of free charges and one resonance, which no film of the catalogue has."""
    energy = 1239.84 / NM
    epsilon = 1 + 2.5 * 36 / (36 - energy**2 - 0.3j * energy) - 2.25 / (energy**2 + 0.8j * energy)
    values = by_tmm.films("s", NM, (1.0, np.sqrt(epsilon), index("Si")), [200.0])
    noise = 0.001 * np.random.default_rng(1).normal(size=NM.size)
    found = pl.identify(pl.Spectrum(NM, values + noise, "R"), "Si", among=["SiO2", "ITO"], layers=1)
    every = {x.name: x for x in (*found.hypotheses, *found.excluded)}
    conductor = every["drude with lorentz"]
    assert conductor in found.hypotheses
    assert abs(conductor.layers[0].thickness.value - 200) < conductor.layers[0].thickness.stderr
    assert conductor.ln_z > every["cauchy"].ln_z + 20
    numbers = dict(zip(FREE_MODELS[CONDUCTOR], (1.5, 0.8, 2.5, 6.0, 0.3), strict=True))
    made = built(CONDUCTOR, numbers).index(NM)
    np.testing.assert_allclose(made.re + 1j * made.im, np.sqrt(epsilon), rtol=1e-4)


@pytest.mark.slow  # ψ and Δ, two layers
def test_an_index_that_no_table_is_near_is_found_below_which_lies_oxide():
    """Rutile, a fifth above the TiO2 of the catalogue, on oxide."""
    rutile = 2.6 + 1.0e5 / NM**2 + 0j
    ncs = by_tmm.ncs(NM, (1.0, rutile, index("SiO2"), index("Si")), [30.0, 260.0], 70.0)
    psi, delta = by_tmm.psi_delta(*ncs.T)
    noise = 0.05 * np.random.default_rng(1).normal(size=(2, NM.size))
    data = pl.Spectrum(
        NM, psi + noise[0], "psi-delta", delta=(delta + noise[1]) % 360, angle=np.full(NM.size, 70.0)
    )
    upper, lower = pl.identify(data, "Si").best.layers
    assert upper.thickness.value == pytest.approx(30, abs=1.5)
    assert lower.thickness.value == pytest.approx(260, abs=3)
    assert "SiO2" in lower.like


@pytest.mark.slow  # compiles a fit of the film
def test_a_fit_confirms_what_is_left():
    spectrum = reflectance(("SiO2", 300.0))
    best = pl.identify(spectrum, "Si").best
    fit = pl.fit(spectrum, best.scene())
    assert fit.status is pl.Status.CONVERGED
    assert abs(fit["thickness"].value - best.layers[0].thickness.value) < fit["thickness"].stderr


def test_what_cannot_be_identified(refuses):
    spectrum = reflectance(("SiO2", 300.0))
    few = pl.Spectrum(NM[:12], spectrum.values[:12], "R")
    counts = pl.Spectrum(NM, spectrum.values * 1000, "counts", calibrated=False)
    ratio = pl.Spectrum(NM, np.linspace(30.0, 31.0, NM.size), "psi-delta", delta=np.full(NM.size, 90.0))
    for data, given, message in (
        (few, {}, "12 points are too few"),
        (pl.Spectrum(NM, np.full(NM.size, 0.2), "R"), {}, "all values are 0.2"),
        (counts, {}, "cannot be identified: give calibrated"),
        (ratio, {}, "need the `angle` of incidence"),
        (spectrum, {"family": "oxides"}, "no family 'oxides'"),
        (spectrum, {"family": "oxide", "among": ["SiO2"]}, "not both"),
        (spectrum, {"among": ["SiO3"]}, "SiO3"),
        (spectrum, {"layers": 3}, "`layers` must be 1 or 2"),
        (spectrum, {"allow": ["lamp"]}, "`allow` must be of calibration, plate"),
        (spectrum, {"among": "SiO2"}, "`among` must be a list of names"),
        (spectrum, {"allow": "plate"}, "`allow` must be a list"),
        (spectrum, {"budget": 0}, "`budget` must be above 0 seconds"),
        ([], {}, "a list of spectra"),
    ):
        refuses(ValueError, message, pl.identify, data, "Si", **given)
    refuses(ValueError, "Sil", pl.identify, spectrum, "Sil")
    refuses(ValueError, "must be known, without free numbers", pl.identify, spectrum, pl.Free(3.0, 4.0))
