"""One colour of a film at normal incidence, clean and with the everyday errors of photographs.

Spectra are those of `transfer_matrix`; colour matching functions and illuminants are the tables of the CIE in
pellicle, everything else is written out here. The recipe takes every colour for clean sRGB under D65.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from media import Index, catalogued, cauchy
from transfer_matrix import power

import pellicle as pl
from pellicle.colour import observers

NM = np.arange(380.0, 781.0, 5.0)
TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
SRGB_WHITE = np.linalg.solve(TO_SRGB, np.ones(3))
KINDS = ("clean", "white balance", "flare", "other camera", "saturation", "lamp", "gamma", "index")
EACH = 6
"""Cases of each kind."""
NOISE = 1.5 / 255


def table(illuminant: str) -> tuple[np.ndarray, np.ndarray]:
    """Colour matching functions of 1931 (N, 3) and an illuminant (N,) at `NM`."""
    eye = observers.sensor("1931", "E")
    lit, light = observers.illuminant_spectrum(illuminant)
    matching = [np.interp(NM, eye.wavelength, x) for x in eye.weights.T]
    return np.stack(matching, axis=1), np.interp(NM, lit, light)


def linear_srgb(reflectance: np.ndarray, illuminant: str) -> np.ndarray:
    """Linear sRGB of a reflectance, by channels that are balanced to white in sRGB."""
    matching, light = table(illuminant)
    xyz, white = reflectance @ (matching * light[:, None]), light @ matching
    bradford = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
    gain = (bradford @ SRGB_WHITE) / (bradford @ (white / white[1]))
    return TO_SRGB @ np.linalg.solve(bradford, gain * (bradford @ (xyz / white[1])))


def by_camera(reflectance: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Linear channels of a camera with bands of its own, by the matrix that suits common colours best."""
    centres, widths = random.normal([600, 535, 455], 10), random.uniform(30, 50, 3)
    bands = np.exp(-0.5 * ((NM[:, None] - centres) / widths) ** 2) * table("D65")[1][:, None]
    bands /= bands.sum(axis=0)
    edges = random.uniform(400, 700, (60, 1))
    common = 0.05 + 0.8 / (1 + np.exp(-random.choice([-1, 1], (60, 1)) * (NM - edges) / 25))
    common = np.vstack([common, np.tile(np.ones(len(NM)), (60, 1))])  # white stays white
    wanted = np.array([linear_srgb(x, "D65") for x in common])
    matrix = np.linalg.lstsq(common @ bands, wanted, rcond=None)[0]
    return (reflectance @ bands) @ matrix


def recorded(kind: str, reflectance: np.ndarray, exposure: float, random: np.random.Generator) -> np.ndarray:
    """Coded channels of a colour without noise."""
    sign = random.choice([-1.0, 1.0])
    linear = linear_srgb(reflectance, "A" if kind == "lamp" else "D65")
    if kind == "other camera":
        linear = by_camera(reflectance, random)
    linear = linear * exposure
    if kind == "white balance":
        linear = linear * (1 + 0.05 * random.choice([-1, 1], 3) * [1, 0, 1])
    if kind == "flare":
        linear = linear + 0.02
    if kind == "saturation":
        grey = linear @ [0.2126, 0.7152, 0.0722]
        linear = grey + (1 + 0.2 * sign) * (linear - grey)
    linear = np.clip(linear, 0, 1)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return coded ** (1 + 0.1 * sign) if kind == "gamma" else coded


def film(random: np.random.Generator) -> tuple[str, Index, str, Index, float]:
    """Film and base, by names for pellicle and by indices, and the exposure that makes them visible."""
    air = cauchy(1.0, 0.0)
    films = [
        ("SiO2", catalogued("SiO2"), "Si", catalogued("Si"), 1.0),
        ("Si3N4", catalogued("Si3N4"), "Si", catalogued("Si"), 1.0),
        ("water", cauchy(1.3242, 3102.0), "air", air, 8.0),
        ("TiO2", catalogued("TiO2"), "BK7", catalogued("BK7"), 1.5),
    ]
    return films[random.integers(len(films))]


def cases(seed: int) -> Iterator[tuple[str, pl.Colours, pl.Scene, float, bool, str]]:
    """Kind, colour, scene of the recipe, true thickness, whether σ is given, and what is true."""
    eye = observers.sensor("1931", "D65")
    for kind in KINDS:
        for number in range(EACH):
            random = np.random.default_rng([seed, KINDS.index(kind), number])
            name, index, base, below, exposure = film(random)
            thickness, free = random.uniform(60, 900), number % 3 == 2
            factor = 1 + 0.02 * random.choice([-1.0, 1.0]) if kind == "index" else 1.0
            media = [np.ones(len(NM)), index(NM) * factor, below(NM)]
            reflectance = power(NM, 0.0, media, [thickness], "s")[0]
            values = recorded(kind, reflectance, exposure, random) + NOISE * random.standard_normal(3)
            values = np.clip(values, 0, 1)[None]
            given = number % 2 == 0
            sigma = np.full((1, 3), NOISE) if given else None
            data = pl.Colours(values, (eye.wavelength, eye.weights), sigma=sigma)
            layer: object = pl.dispersion.Cauchy(1.3242, 3102.0) if name == "water" else name
            instrument = pl.Instrument(scale="free" if free else exposure)
            scene = pl.Scene(pl.Layer(layer, pl.Free(10, 1000)), base, instrument=instrument)
            detail = f"{name} on {base}, {thickness:.4g} nm, {values.round(3)}"
            yield kind, data, scene, thickness, given, detail
