"""The families of samples that verdicts are tested on, with their recipes."""

from __future__ import annotations

from dataclasses import replace

from family import (
    Bounds,
    Family,
    cauchy_layer,
    depth,
    depth_and_cauchy,
    ellipsometer_view,
    log_uniform,
    one_layer,
    recipe,
    spectrum_view,
)
from measurement import Stack
from media import air, catalogued, cauchy, lorentz

CAUCHY: Bounds = ((1.2, 3.0), (0.0, 1e5))
WATER = (1.324188, 3102.06)
PARYLENE = (1.602, 11800.0)
PLATE = '{ material = "BK7", back = "air", plate_mm = 1.0 }'
R, T = spectrum_view("R", 400, 900, 251), spectrum_view("T", 450, 950, 251)
SI, BK7 = catalogued("Si"), catalogued("BK7")
FIXED = "fixed-index"

FAMILIES = {
    family.name: family
    for family in (
        Family(
            "oxide-R",
            recipe("R", '"Si"', '"SiO2"', (10, 3000)),
            R,
            (5e-4, 3e-3),
            ((10, 3000),),
            depth(60, 1500),
            one_layer(catalogued("SiO2"), SI),
            frozenset({FIXED, "solid"}),
        ),
        Family(
            "nitride-R",
            recipe("R", '"Si"', '"Si3N4"', (10, 2000)),
            R,
            (5e-4, 3e-3),
            ((10, 2000),),
            depth(60, 800),
            one_layer(catalogued("Si3N4"), SI),
            frozenset({FIXED, "solid", "on-silicon"}),
        ),
        Family(
            "resist-R",
            recipe("R", '"Si"', '"cauchy"', (10, 5000)),
            R,
            (5e-4, 3e-3),
            ((10, 5000), *CAUCHY),
            depth_and_cauchy(300, 2500, (1.45, 1.68), (3e3, 1e4)),
            cauchy_layer(SI),
            frozenset({"cauchy", "solid", "on-silicon"}),
        ),
        Family(
            "coat-R",
            recipe(
                "R",
                '"BK7"',
                f'{{ model = "cauchy", A = {PARYLENE[0]}, B = {PARYLENE[1]} }}',
                (3000, 20000),
                instrument="bandwidth = { lower = 0.2, upper = 5 }",
            ),
            spectrum_view("R", 450, 950, 1001),
            (3e-4, 1e-3),
            ((3000, 20000), (0.2, 5)),
            lambda random: (random.uniform(5000, 15000), random.uniform(1.0, 2.0)),
            one_layer(cauchy(*PARYLENE), BK7),
            frozenset({FIXED, "solid", "bandwidth"}),
            bandwidth=1,
        ),
        Family(
            "titania-T",
            recipe("T", PLATE, '"cauchy"', (10, 1500)),
            T,
            (5e-4, 3e-3),
            ((10, 1500), *CAUCHY),
            depth_and_cauchy(80, 600, (2.15, 2.35), (2e4, 4.5e4)),
            cauchy_layer(BK7, 1.0),
            frozenset({"cauchy", "solid"}),
        ),
        Family(
            "absorber-R",
            recipe("R", '"BK7"', '"lorentz"', (10, 1000)),
            R,
            (5e-4, 2e-3),
            ((10, 1000), (1, 6), (0, 10), (1, 10), (0.01, 4)),
            lambda random: (
                log_uniform(random, 60, 400),
                random.uniform(3.5, 5.0),
                random.uniform(1.0, 2.0),
                random.uniform(2.9, 3.4),
                random.uniform(0.4, 1.0),
            ),
            lambda theta: Stack(((lorentz(*theta[1:]), theta[0]),), BK7),
            frozenset({"lorentz", "solid"}),
        ),
        Family(
            "gold-T",
            recipe("T", PLATE, '"Au"', (1, 200)),
            T,
            (5e-4, 2e-3),
            ((1, 200),),
            depth(8, 60),
            one_layer(catalogued("Au"), BK7, 1.0),
            frozenset({FIXED, "solid"}),
        ),
        Family(
            "oxide-psi",
            recipe("psi-delta", '"Si"', '"SiO2"', (1, 1000)),
            ellipsometer_view(400, 900, 101, 70.0),
            (1e-3, 4e-3),
            ((1, 1000),),
            depth(5, 500),
            one_layer(catalogued("SiO2"), SI),
            frozenset({FIXED, "solid"}),
        ),
        Family(
            "oxide-psi3",
            recipe("psi-delta", '"Si"', '"SiO2"', (1, 1000)),
            ellipsometer_view(400, 900, 51, 65.0, 70.0, 75.0),
            (1e-3, 4e-3),
            ((1, 1000),),
            depth(5, 500),
            one_layer(catalogued("SiO2"), SI),
            frozenset({FIXED, "solid"}),
        ),
        Family(
            "polymer-psi3",
            recipe("psi-delta", '"Si"', '"cauchy"', (1, 2000)),
            ellipsometer_view(400, 900, 51, 65.0, 70.0, 75.0),
            (1e-3, 4e-3),
            ((1, 2000), *CAUCHY),
            depth_and_cauchy(60, 900, (1.45, 1.65), (3e3, 1e4)),
            cauchy_layer(SI),
            frozenset({"cauchy", "solid", "on-silicon"}),
        ),
        Family(
            "soap-R",
            recipe(
                "R",
                '"air"',
                f'{{ model = "cauchy", A = {WATER[0]}, B = {WATER[1]} }}',
                (10, 6000),
                instrument='scale = "slow"\noffset = "slow"',
            ),
            spectrum_view("R", 500, 900, 401),
            (2e-3, 1.5e-2),
            ((10, 6000),),
            depth(350, 4000),
            one_layer(cauchy(*WATER), air),
            frozenset({FIXED, "counts"}),
            gain=3,
            dark=2,
            counts=True,
        ),
    )
}


def _thin(name: str, low: float, high: float) -> Family:
    """A family with thicknesses of `low` to `high` nm, and its other numbers as they are."""
    family = FAMILIES[name]
    return replace(
        family,
        name=f"thin {name}",
        draw=lambda random: (log_uniform(random, low, high), *family.draw(random)[1:]),
    )


THIN = tuple(
    _thin(name, low, high)
    for name, low, high in (
        ("oxide-R", 12, 60),
        ("nitride-R", 12, 60),
        ("titania-T", 20, 80),
        ("gold-T", 8, 30),
        ("oxide-psi", 4, 40),
        ("polymer-psi3", 20, 60),
    )
)
"""Thin films, of which an overlayer or pores are a good part."""
