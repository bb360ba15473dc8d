"""Measurements that cannot decide a thickness: too thin, opaque, too few orders, without contrast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from families import BK7, CAUCHY, FAMILIES, PLATE, SI
from family import (
    Family,
    cauchy_layer,
    depth,
    depth_and_cauchy,
    ellipsometer_view,
    one_layer,
    recipe,
    spectrum_view,
)
from measurement import View
from media import catalogued, cauchy

FREE = 'scale = "free"\noffset = "free"'
SILICA, HEMATITE = catalogued("SiO2"), catalogued("Fe2O3")
LOW_CONTRAST = (1.5085, 4200.0)


UNDECIDABLE = (
    Family(
        "oxide too thin, scale free",
        recipe("R", '"Si"', '"SiO2"', (0.1, 1000), instrument='scale = "free"'),
        spectrum_view("R", 400, 900, 251),
        (2e-3, 3e-3),
        ((0.1, 1000),),
        depth(0.5, 2),
        one_layer(SILICA, SI),
        gain=0,
    ),
    Family(
        "polymer too thin for its index",
        recipe("psi-delta", '"Si"', '"cauchy"', (0.1, 1000)),
        ellipsometer_view(400, 900, 51, 65.0, 70.0, 75.0),
        (4e-3, 6e-3),
        ((0.1, 1000), *CAUCHY),
        depth_and_cauchy(0.4, 1.0, (1.45, 1.65), (3e3, 1e4)),
        cauchy_layer(SI),
    ),
    Family(
        "opaque gold",
        recipe("R", '"BK7"', '"Au"', (5, 1000)),
        spectrum_view("R", 400, 900, 251),
        (1e-3, 3e-3),
        ((5, 1000),),
        depth(250, 500),
        one_layer(catalogued("Au"), BK7),
    ),
    Family(
        "opaque hematite",
        recipe("R", '"BK7"', '"Fe2O3"', (5, 10000)),
        spectrum_view("R", 400, 500, 101),
        (1e-3, 3e-3),
        ((5, 10000),),
        depth(2000, 5000),
        one_layer(HEMATITE, BK7),
    ),
    Family(
        "short range, scale and offset free",
        recipe("R", '"Si"', '"SiO2"', (10, 3000), instrument=FREE),
        spectrum_view("R", 640, 660, 41),
        (1e-3, 3e-3),
        ((10, 3000),),
        depth(300, 2500),
        one_layer(SILICA, SI),
        gain=0,
        dark=0,
    ),
    replace(FAMILIES["soap-R"], name="soap film of order zero", draw=depth(10, 60)),
    Family(
        "film of the substrate's index",
        recipe("R", '"BK7"', '"BK7"', (10, 3000)),
        spectrum_view("R", 400, 900, 251),
        (1e-3, 3e-3),
        ((10, 3000),),
        depth(60, 1500),
        one_layer(BK7, BK7),
    ),
    Family(
        "fringes below the noise",
        recipe(
            "R",
            '"BK7"',
            f'{{ model = "cauchy", A = {LOW_CONTRAST[0]}, B = {LOW_CONTRAST[1]} }}',
            (3000, 20000),
        ),
        spectrum_view("R", 450, 950, 251),
        (0.01, 0.01),
        ((3000, 20000),),
        depth(5000, 15000),
        one_layer(cauchy(*LOW_CONTRAST), BK7),
    ),
    Family(
        "one laser line",
        recipe("psi-delta", '"Si"', '"SiO2"', (10, 5000)),
        ellipsometer_view(632.6, 633.0, 5, 70.0),
        (5e-3, 5e-3),
        ((10, 5000),),
        depth(100, 1500),
        one_layer(SILICA, SI),
    ),
    Family(
        "three bands",
        recipe("R", '"Si"', "1.46", (50, 1500)),
        View("R", np.array([460.0, 530.0, 630.0]), np.zeros(3)),
        (0.02, 0.02),
        ((50, 1500),),
        depth(500, 1400),
        one_layer(cauchy(1.46, 0.0), SI),
    ),
    Family(
        "thin silica on glass in T, scale slow",
        recipe("T", PLATE, '"SiO2"', (10, 2000), instrument='scale = "slow"'),
        spectrum_view("T", 450, 950, 251),
        (2e-3, 3e-3),
        ((10, 2000),),
        depth(20, 60),
        one_layer(SILICA, BK7, 1.0),
        gain=3,
    ),
)
