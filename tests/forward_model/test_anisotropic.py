"""Scenes with birefringent media: closed forms against published formulas, plans and refusals."""

from typing import Any

import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.empirical import Constant
from pellicle.effects.film_plan import exact
from pellicle.forward_model.plan import GENERAL, SLICED

NM = np.linspace(500.0, 700.0, 16)
ORDINARY, EXTRAORDINARY = 1.658, 1.486  # calcite at 589 nm (Ghosh 1999, to 1e-3)
ANGLE = 60.0


def scene(
    layers: Any, substrate: Any = "BK7", signal: str = "R", polarisation: str = "p", angle: float = ANGLE
):
    return pl.Scene(layers, substrate, light=pl.Light(NM, angle, signal, polarisation))


def values(scene: pl.Scene) -> np.ndarray:
    return np.asarray(pl.simulate(scene, NM).values)


def uniaxial_face(polarisation: str, axis: str) -> float:
    """Power reflectance of a crystal in air, Azzam and Bashara (1977), equations 4.216 to 4.221.

    The optic axis is the normal (z), in the plane of incidence (x), or normal to that plane (y).
    """
    no, ne, cos, sin = ORDINARY, EXTRAORDINARY, np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE))
    if polarisation == "s":
        n = ne if axis == "y" else no
        a, b = cos, np.sqrt(n**2 - sin**2)
    elif axis == "z":
        a, b = no * ne * cos, np.sqrt(ne**2 - sin**2)
    elif axis == "x":
        a, b = no * ne * cos, np.sqrt(no**2 - sin**2)
    else:
        a, b = no**2 * cos, np.sqrt(no**2 - sin**2)
    return ((a - b) / (a + b)) ** 2


AXES = {"x": (90, 0), "y": (90, 90), "z": (0, 0)}


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("polarisation", ["s", "p"])
def test_bare_crystal_reflects_as_published(polarisation, axis):
    calcite = pl.Anisotropic(ORDINARY, EXTRAORDINARY, axis=AXES[axis])
    bare = scene(pl.Layer(1.0, 0.0), calcite, polarisation=polarisation)
    np.testing.assert_allclose(values(bare), uniaxial_face(polarisation, axis), rtol=1e-12)


def test_incoherent_crystal_plate_adds_intensities_of_each_polarisation():
    calcite = pl.Anisotropic(ORDINARY, EXTRAORDINARY)
    plate = [pl.Layer(1.0, 0.0), pl.Plate(calcite, 1.0)]
    for polarisation in "sp":
        face = uniaxial_face(polarisation, "z")
        for signal, expected in (("R", 2 * face / (1 + face)), ("T", (1 - face) / (1 + face))):
            own = scene(plate, 1.0, signal, polarisation)
            np.testing.assert_allclose(values(own), expected, rtol=1e-12)


def test_in_plane_axis_separates_s_and_p_at_normal_incidence():
    crystal = pl.Anisotropic(ORDINARY, EXTRAORDINARY, axis=(90, 0))
    one = {p: values(scene(pl.Layer(1.0, 0.0), crystal, "R", p, 0.0)) for p in ("s", "p", "unpolarised")}
    np.testing.assert_allclose(one["s"], ((ORDINARY - 1) / (ORDINARY + 1)) ** 2, rtol=1e-12)
    np.testing.assert_allclose(one["p"], ((EXTRAORDINARY - 1) / (EXTRAORDINARY + 1)) ** 2, rtol=1e-12)
    np.testing.assert_allclose(one["unpolarised"], (one["s"] + one["p"]) / 2, rtol=1e-12)


@pytest.mark.parametrize(
    ("medium", "on", "count"),
    [
        (1.6, False, 0),
        (pl.Anisotropic(1.6, 1.7), True, 2),
        (pl.Anisotropic(1.6, 1.7, axis=(90, 0)), True, 2),
        (pl.Anisotropic(1.6, 1.7, axis=(0, pl.Free(0, 90))), True, 2),  # of no consequence
        (pl.Anisotropic(1.6, 1.7, axis=(45, 0)), True, 4),
        (pl.Anisotropic(1.6, 1.7, axis=(pl.Free(0, 90), 0)), True, 4),
        (pl.Anisotropic(x=1.5, y=1.6, z=1.7, axis=(90, 90, 0)), True, 2),
        (pl.Anisotropic(x=1.5, y=1.6, z=1.7, axis=(0, 0, 30)), True, 4),
    ],
)
def test_plan_chooses_the_method_by_the_type_of_the_orientation(medium, on, count):
    row = pl.plan(scene(pl.Layer(medium, pl.Free(10, 100)))).row("anisotropy")
    assert (row.on, row.count) == (on, count)


SLOW = pytest.mark.slow  # 10 s of compilation each


@pytest.mark.parametrize(
    ("signal", "k"), [("mueller", 0), *(pytest.param(x, 0.1j, marks=SLOW) for x in ("R", "T", "psi-delta"))]
)
def test_general_method_equals_the_closed_form_where_both_compute(signal, k):
    """The plan takes 4×4 for a free angle, whatever its value."""
    closed = pl.Anisotropic(ORDINARY, EXTRAORDINARY + k)
    general = pl.Anisotropic(ORDINARY, EXTRAORDINARY + k, axis=(pl.Free(0, 90, start=0), 20.0))
    one, other = (pl.simulate(scene(pl.Layer(x, 300.0), "Si", signal), NM) for x in (closed, general))
    np.testing.assert_allclose(other.values, one.values, rtol=0, atol=1e-10)
    if one.delta is not None:
        np.testing.assert_allclose(other.delta, one.delta, rtol=0, atol=1e-9)


def test_slices_only_where_one_wave_may_decay_within_the_bounds():
    def size(ordinary: Any, thickness: Any, angle: float = ANGLE) -> int:
        crystal = pl.Anisotropic(ordinary, 1.75 + 0.05j, axis=(40.0, 25.0))
        at = pl.Scene(pl.Layer(crystal, thickness), "Si", light=pl.Light(NM, angle))
        return exact(at).row("anisotropy").count

    # 2π · 0.05 · 400/400 is a tenth of the limit, and ten times the limit in a layer of 40 µm
    assert size(1.6, pl.Free(100, 400)) == GENERAL
    assert size(1.6, pl.Free(100, 40_000)) == SLICED
    assert size(Constant(1.6, pl.Free(0, 0.01)), 400.0) == GENERAL
    assert size(Constant(1.6, pl.Free(0, 2)), 400.0) == SLICED
    # a wave of index 0.8 is evanescent at 60 degrees
    assert size(0.8, 400.0) == SLICED
    assert size(0.8, 400.0, angle=20.0) == GENERAL


def test_what_is_not_computed_is_refused(refuses):
    crystal, tilted = pl.Anisotropic(1.6, 1.7), pl.Anisotropic(1.6, 1.7, axis=(30, 0))
    refused = {
        "mixed interface": lambda: scene([pl.Layer(crystal, 10.0), pl.Interface(2.0)]),
        "ambient": lambda: pl.Scene(pl.Layer(1.5, 10.0), "Si", ambient=crystal),
        "mixture": lambda: pl.mixing.Bruggeman(crystal, pl.material("SiO2"), 0.5),
        "incoherent plate": lambda: pl.plan(scene([pl.Layer(1.5, 9.0), pl.Plate(tilted, 1.0)])),
        "back face": lambda: pl.plan(scene([pl.Layer(1.5, 9.0), pl.Plate(crystal, 1.0)], 1.0, "psi-delta")),
        "birefringent plate": lambda: pl.plan(scene([pl.Layer(tilted, 9.0), pl.Plate(crystal, 1.0)])),
        "fields": lambda: pl.absorptance(NM, 10.0, crystal, "Si", angle=ANGLE),
        "pl.jones": lambda: pl.reflectance(NM, 10.0, tilted, "Si", angle=ANGLE),
        "mixtures with the ambient": lambda: pl.plan(scene(pl.Layer(tilted, 10.0, roughness=1.0))),
        "R and T only": lambda: pl.plan(
            scene([pl.Layer(crystal, 9.0, roughness=1.0), pl.Plate(1.5, 1.0)], 1.0, "psi-delta")
        ),
    }
    for words, make in refused.items():
        refuses(ValueError, words, make)
