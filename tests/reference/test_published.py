"""Numbers that textbooks and papers give, and what they say of real films."""

import itertools

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import film_colour
from pellicle.materials import material


def test_quarter_wave_of_magnesium_fluoride():
    """((n₀n₂ − n₁²)/(n₀n₂ + n₁²))²: Born and Wolf, Principles of Optics, section 1.6.4; 1.26 % on glass."""
    n, glass, wavelength = 1.38, 1.52, 550.0
    found = pl.reflectance(wavelength, wavelength / (4 * n), n, glass)
    assert found == pytest.approx(((glass - n**2) / (glass + n**2)) ** 2, rel=1e-13)
    assert found == pytest.approx(0.0126, abs=5e-5)


def test_ideal_antireflection():
    """n₁ = √(n₀n₂) at a quarter wave reflects nothing (same section)."""
    n = np.sqrt(1.52)
    assert pl.reflectance(550.0, 550.0 / (4 * n), n, 1.52) == pytest.approx(0, abs=1e-30)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_a_half_wave_layer_is_absent(order):
    """An optical thickness of mλ/2 leaves the bare substrate (same section)."""
    found = pl.reflectance(550.0, order * 550.0 / (2 * 2.35), 2.35, 1.52)
    assert found == pytest.approx((0.52 / 2.52) ** 2, rel=1e-12)


def test_a_half_wave_at_an_angle():
    """There it is n cos θ₁ that counts."""
    cosine = np.sqrt(1 - (np.sin(np.deg2rad(60)) / 2.35) ** 2)
    for letter in "sp":
        bare, layered = (
            pl.reflectance(550.0, d, 2.35, 1.52, angle=60.0, polarisation=letter)
            for d in (0.0, 550.0 / (2 * 2.35 * cosine))
        )
        assert float(layered) == pytest.approx(float(bare), rel=1e-12)


def test_bare_glass_and_its_brewster_angle():
    """4 % at normal incidence; none of p at tan θ = n (D. Brewster, 1815)."""
    assert pl.reflectance(550.0, 0.0, 1.46, 1.5) == pytest.approx(0.04)
    brewster = np.rad2deg(np.arctan(1.5))
    assert pl.reflectance(550.0, 0.0, 1.46, 1.5, angle=brewster, polarisation="p") < 1e-30


def test_frustrated_total_reflection():
    """45° prisms a gap apart, s: T = 1/(1 + sinh²(κd)·((n²−1)²/(4n²cos²θ(n²sin²θ−1)))).

    S. Zhu et al., Am. J. Phys. 54, 601 (1986), eq. 1.
    """
    n, theta, gap, wavelength = 1.517, np.deg2rad(45), 300.0, 632.8
    root = (n * np.sin(theta)) ** 2 - 1
    alpha = (n**2 - 1) ** 2 / (4 * n**2 * np.cos(theta) ** 2 * root)
    truth = 1 / (1 + alpha * np.sinh(2 * np.pi * gap / wavelength * np.sqrt(root)) ** 2)
    found = pl.transmittance(wavelength, gap, 1.0, n, ambient=n, angle=45.0, polarisation="s")
    assert found == pytest.approx(truth, rel=1e-12)


@pytest.fixture(scope="module")
def published(load_script):
    return load_script("benchmarks/published.py")


@pytest.mark.parametrize(
    "study",
    [
        "sapphire_window",
        "brewster_angles",
        *(pytest.param(long, marks=pytest.mark.slow) for long in ("gooch_tarry", "rugate_filters")),
    ],
)
def test_numbers_are_those_published(published, study):
    for row in getattr(published, study)():
        assert row.computed == pytest.approx(row.published, abs=row.tolerance), row.quantity


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
