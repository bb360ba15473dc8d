"""Ψ and Δ of transmitted light: values by the package tmm, fits in Python and by the command, files."""

import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.write_spectrum import write_spectrum
from pellicle.errors import UsageError
from pellicle.recipes.read import read_recipe
from pellicle.recipes.write import recipe_text
from tests.film_recipes import TRANSMISSION

NM = np.linspace(450.0, 750.0, 64)
ANGLE, INDEX, GLASS = 60.0, 2.1 + 0.01j, 1.52
LIGHT = pl.Light(angle=ANGLE, signal="psi-delta", transmission=True)
WOOLLAM = """VASEmethod[EllipsometerType=4, TransmissionMeas=1 , CompleteEASE=5.19]
nm
{rows}
"""


def scene(substrate=GLASS, **more) -> pl.Scene:
    return pl.Scene(pl.Layer(INDEX, pl.Free(10.0, 400.0, start=180.0)), substrate, light=LIGHT, **more)


def by_tmm(thickness: float) -> tuple[np.ndarray, np.ndarray]:
    stack, depths, angle = [1.0, INDEX, GLASS], [np.inf, thickness, np.inf], np.deg2rad(ANGLE)
    p, s = (np.array([tmm.coh_tmm(x, stack, depths, angle, nm)["t"] for nm in NM]) for x in "ps")
    rho = np.conj(p / s)
    return np.rad2deg(np.arctan(np.abs(rho))), np.rad2deg(np.angle(rho)) % 360


def test_values_of_tmm():
    simulated = pl.simulate(scene(), NM)
    psi, delta = by_tmm(180.0)
    np.testing.assert_allclose(simulated.values, psi, atol=1e-9)
    np.testing.assert_allclose(simulated.delta, delta, atol=1e-9)
    assert simulated.transmission


@pytest.mark.slow  # compiles for 3 s
def test_the_jones_matrix_of_a_layer_that_turns_nothing(refuses):
    """The 4×4 method, which a birefringent layer takes, and `pellicle.jones` agree with the 2×2 method."""
    tilted = pl.Anisotropic(1.7, 1.6, axis=(40.0, 30.0))
    layer = pl.Scene(pl.Layer(tilted, 300.0), GLASS, light=LIGHT)
    simulated = pl.simulate(layer, NM)
    matrix = pl.jones(NM, 300.0, tilted, GLASS, angle=ANGLE, side="transmission")
    rho = np.conj(matrix[:, 0, 0] / matrix[:, 1, 1])
    np.testing.assert_allclose(np.tan(np.deg2rad(simulated.values)), np.abs(rho), rtol=1e-9)
    np.testing.assert_allclose(np.exp(1j * np.deg2rad(simulated.delta)), rho / np.abs(rho), atol=1e-9)
    on_plate = pl.Scene(pl.Layer(tilted, 300.0), pl.Substrate(GLASS, 1.0), light=LIGHT)
    refuses(UsageError, "half space", pl.simulate, on_plate, NM)


def test_nothing_in_the_way_turns_nothing():
    empty = pl.simulate(pl.Scene(pl.Layer(1.0, 100.0), 1.0, light=LIGHT), NM)
    np.testing.assert_allclose(empty.values, 45.0, atol=1e-9)
    np.testing.assert_allclose((empty.delta + 180) % 360, 180.0, atol=1e-9)


def test_a_plate_adds_its_orders():
    """N is that of the transmittances for s and p; the light of all orders is partly unpolarised."""
    plate = pl.Substrate(GLASS, 1.0)
    simulated = pl.simulate(scene(plate), NM)
    lights = [pl.Light(angle=ANGLE, signal="T", polarisation=x) for x in "sp"]
    powers = [pl.simulate(pl.Scene(pl.Layer(INDEX, 180.0), plate, light=x), NM).values for x in lights]
    length = np.sqrt(1 - simulated.depolarisation)
    n = (powers[0] - powers[1]) / (powers[0] + powers[1])
    np.testing.assert_allclose(length * np.cos(2 * np.deg2rad(simulated.values)), n, atol=1e-9)
    assert 0 < simulated.depolarisation.min() < simulated.depolarisation.max() < 0.2


@pytest.mark.slow  # compiles a fit of its own
def test_the_fit_finds_the_thickness():
    fit = pl.fit(pl.simulate(scene(), NM, noise=0.02, seed=1), scene())
    found = fit.parameters["thickness"]
    assert fit.status == "converged"
    assert abs(found.value - 180.0) < 3 * found.stderr


def test_words(refuses):
    refuses(UsageError, "`transmission` goes with", pl.Light, signal="R", transmission=True)
    refuses(UsageError, "`transmission` goes with", pl.Spectrum, NM, np.full(64, 0.2), "R", transmission=True)


def test_files(tmp_path, write):
    written = pl.simulate(scene(), NM, noise=0.02)
    write_spectrum(tmp_path / "t.csv", written)
    assert read_spectrum(tmp_path / "t.csv").transmission
    assert not read_spectrum(tmp_path / "t.csv", transmission=False).transmission
    rows = "\n".join(
        f"E\t{nm}\t{ANGLE}\t{psi}\t{delta}\t0.02\t0.02"
        for nm, psi, delta in zip(NM, *by_tmm(180.0), strict=True)
    )
    (tmp_path / "woollam.dat").write_text(WOOLLAM.format(rows=rows), encoding="utf-8")
    woollam = read_spectrum(tmp_path / "woollam.dat")
    assert woollam.transmission
    assert "transmitted light" in " ".join(woollam.notes)
    reflected = write("wavelength_nm,R\n" + "\n".join(f"{nm},0.2" for nm in NM), "r.csv")
    with pytest.raises(UsageError, match=r"r\.csv: `transmission` is for ellipsometry"):
        read_spectrum(reflected, transmission=True)


def test_a_recipe_both_ways(tmp_path):
    path, again = tmp_path / "t.toml", tmp_path / "again.toml"
    path.write_text(TRANSMISSION, encoding="utf-8")
    read = read_recipe(path).scene()
    assert read.light.transmission
    again.write_text(recipe_text(read, tmp_path), encoding="utf-8")
    assert read_recipe(again).scene().light.transmission
