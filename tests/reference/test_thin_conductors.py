"""What Gerardin, Holzschuch and Martinetto 2019 (thin conductors and semi-conductors) say of real films."""

import itertools

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import film_colour
from pellicle.materials import material

VISIBLE = np.linspace(400.0, 700.0, 61)


def on_glass(function, name, thickness, wavelength=VISIBLE):
    """R or T of a film on glass; 61 points in every call, so that all share what is compiled."""
    wavelength, thickness = (np.broadcast_to(x, VISIBLE.shape).copy() for x in (wavelength, thickness))
    return np.asarray(function(wavelength, thickness, material(name)(wavelength), 1.52))


@pytest.mark.slow
def test_hematite_runs_through_the_temper_colours_three_times():
    """Figure 1, by what is reflected as the layer grows to 300 nm: the order that oxide on heated steel
    is known for, straw, red, purple, blue, green; paler each time, as hematite takes the blue.

    By 64 wavelengths: Gaussians are for indices that change less, and pass over the last, pale straw.
    """
    thickness = np.arange(40.0, 287.0, 2.0)
    _, a, b = np.asarray(film_colour(thickness, material("Fe2O3"), 1.52, method="uniform-64").lab).T
    hue, chroma = np.rad2deg(np.unwrap(np.arctan2(b, a))), np.hypot(a, b)
    assert np.all(np.diff(hue) < 0)
    edges = np.array([45.0, 115.0, 220.0, 290.0, 345.0])
    names = np.array(["red", "straw", "green", "blue", "purple", "red"])
    seen = names[np.searchsorted(edges, hue % 360)]
    assert [name for name, _ in itertools.groupby(seen)] == 3 * ["straw", "red", "purple", "blue", "green"]
    orders = np.floor((hue[0] - hue + 20) / 360).astype(int)
    strongest = [np.max(chroma[orders == i]) for i in range(3)]
    assert strongest[0] > strongest[1] > strongest[2]


def test_gold_lets_light_through_at_30_nm_and_hardly_any_above_100():
    """Section 1: "less than 30 nm for gold"; section 5: above 100 nm "almost opaque"."""
    assert np.mean(on_glass(pl.transmittance, "Au", 30.0)) > 0.2
    assert np.max(on_glass(pl.transmittance, "Au", 100.0)) < 0.02
    assert np.max(on_glass(pl.transmittance, "Au", 150.0)) < 0.002


def test_fringes_are_weaker_in_metals_than_in_semiconductors():
    """Section 5, as the span of R over thicknesses from 100 nm to 1 µm, in the red."""

    def span(name):
        return np.ptp(on_glass(pl.reflectance, name, np.linspace(100.0, 1000.0, 61), 650.0))

    assert max(span("Au"), span("Al")) < 0.01
    assert min(span("CdS"), span("Fe2O3")) > 0.1


def test_cadmium_sulfide_at_1_mm_by_two_tables():
    """Section 5: "partially transparent even at 1 mm". So says Treharne's table above the gap; Ninomiya's
    model, the catalogue's default, leaves k = 0.036 at 700 nm, and nothing passes 1 mm of that."""
    red = np.linspace(600.0, 700.0, 61)
    assert np.min(on_glass(pl.transmittance, "main/CdS/Treharne", 1e6, red)) > 0.4
    assert np.max(on_glass(pl.transmittance, "main/CdS/Treharne", 1e6, np.linspace(400, 500, 61))) < 1e-9
    assert np.imag(material("CdS")(red))[-1] == pytest.approx(0.036, abs=1e-3)
    assert np.max(on_glass(pl.transmittance, "CdS", 1e6, red)) < 1e-200


def test_one_power_weight_loses_a_hundredth_of_p_and_half_of_that_unpolarised():
    """Eq. 21 weights s and p by Re(n cos θ); p needs Re(n conj(cos θ)) over an absorbing substrate."""
    film, substrate, angle = (550.0, 100.0, 1.46), 0.2 + 3.4j, 60.0
    R, T = (
        {p: float(f(*film, substrate, angle=angle, polarisation=p)) for p in "sp"}
        for f in (pl.reflectance, pl.transmittance)
    )
    assert R["s"] + T["s"] == pytest.approx(1, abs=1e-14)
    assert R["p"] + T["p"] == pytest.approx(1, abs=1e-14)
    cosine = np.sqrt(1 - (np.sin(np.deg2rad(angle)) / substrate) ** 2 + 0j)
    T_p = T["p"] * np.real(substrate * cosine) / np.real(substrate * np.conj(cosine))
    assert R["p"] + T_p == pytest.approx(0.9895, abs=5e-5)
    assert (R["s"] + T["s"] + R["p"] + T_p) / 2 == pytest.approx(0.9947, abs=5e-5)
