"""The list of cases: samples, what is said about them, and how they are measured.

Every case has random numbers of its own, seeded by the master seed and its name: adding a case changes no
other, and none is picked by its answer.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np
from specimens import ABSORBING, Flaws, Layer, Specimen, View, drawn_flaws

SEED, HELD_OUT = 34, 2634
"""Master seeds: of cases on which rules may be tuned, and of those on which none was."""
FILMS = (
    *("SiO2", "MgF2", "PMMA", "polystyrene", "alumina", "Y2O3", "HfO2", "Si3N4", "ZnO", "Ta2O5", "Nb2O5"),
    *("TiO2", "ZnS", "ITO", "Cu2O"),
)
THICKNESSES = (30.0, 120.0, 450.0)
SETTINGS = ("R on Si", "R on glass", "T on glass", "psi-delta on Si")
PAIRS = (
    *(("SiO2", "TiO2"), ("TiO2", "SiO2"), ("polystyrene", "Si3N4"), ("Si3N4", "SiO2"), ("Al2O3", "SiO2")),
    *(("MgF2", "HfO2"), ("ZnO", "SiO2"), ("PMMA", "SiO2"), ("Ta2O5", "MgF2"), ("Y2O3", "SiO2")),
)


@dataclass(frozen=True)
class Case:
    """One measurement: its group, the sample, the view, and the substrate and back face that are stated.

    `expected` is "film" where the stated substrate and the instrument are right, "mistake" where they are
    not, and "bare" without a film. `reference` names the mirror to which R is relative without a word.
    """

    name: str
    group: str
    specimen: Specimen
    view: View
    stated: str
    back: str = ""
    expected: str = "film"
    reference: str = ""

    def random(self, seed: int) -> np.random.Generator:
        """Random numbers of the noise."""
        return _random(seed, f"{self.name} noise")


def _random(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def _view(random: np.random.Generator, setting: str, level: float | None = None) -> View:
    if setting.startswith("psi"):
        noise = float(np.exp(random.uniform(*np.log((0.03, 0.2))))) if level is None else level
        return View("psi-delta", 70.0, noise)
    noise = float(np.exp(random.uniform(*np.log((0.001, 0.01))))) if level is None else level
    return View(setting[0], 0.0, noise)


def _case(
    group: str, name: str, setting: str, layers: tuple[Layer, ...], seed: int, *, flawed: bool = True, **other
) -> Case:
    name = f"{group} | {name} | {setting}"
    random = _random(seed, name)
    layers = tuple(
        Layer(x.material, x.thickness * random.uniform(0.85, 1.15), random.normal(1, 0.005)) for x in layers
    )
    view = _view(random, setting, None if flawed else 0.03 if setting.startswith("psi") else 0.001)
    deepest = max((x.thickness for x in layers), default=0.0)
    flaws = drawn_flaws(random, view.signal, deepest) if flawed else Flaws()
    substrate = "Si" if setting.endswith("Si") else "BK7"
    back = "air" if setting.startswith("T") else ""
    specimen = Specimen(layers, substrate, back, flaws)
    return Case(name, group, specimen, view, stated=substrate, back=back, **other)


def cases(seed: int) -> list[Case]:
    """All cases in a fixed order."""
    found = []
    for i, film in enumerate(FILMS):
        for j, depth in enumerate(THICKNESSES):
            for k in (0, 1):
                setting = SETTINGS[(i + j + 2 * k) % len(SETTINGS)]
                found.append(_case("one film", f"{film} {depth:g} nm", setting, (Layer(film, depth),), seed))
    for film in FILMS:
        for depth in (60.0, 250.0):
            layers = (Layer(film, depth),)
            found.append(_case("clean", f"{film} {depth:g} nm", SETTINGS[3], layers, seed, flawed=False))
    for i, (top, bottom) in enumerate(PAIRS):
        for k in range(3):
            setting = SETTINGS[(i + k) % len(SETTINGS)]
            layers = (Layer(top, (60.0, 150.0, 90.0)[k]), Layer(bottom, (120.0, 80.0, 300.0)[k]))
            found.append(_case("two layers", f"{top} on {bottom} {k + 1}", setting, layers, seed))
    found += _mistakes(seed)
    for i in range(12):
        setting = SETTINGS[i % 4]
        found.append(_case("no film", f"bare {i + 1}", setting, (), seed, expected="bare"))
    for i in range(20):
        setting, film = SETTINGS[(0, 3)[i % 2]], ("Si3N4", "alumina", "HfO2", "Y2O3", "SiO2")[i % 5]
        base = (Layer(film, 80.0 + 20.0 * i),)
        other = Layer("polystyrene" if film != "SiO2" else "TiO2", 30.0)
        found.append(_case("not there", f"{film} {i + 1}", setting, base, seed))
        found.append(_case("there", f"{other.material} on {film} {i + 1}", setting, (other, *base), seed))
    return found


def _mistakes(seed: int) -> list[Case]:
    """Substrates that are not those stated, and reflectances against a mirror that nobody divided out."""
    found = []
    for i in range(12):
        film, depth = FILMS[i], (90.0, 200.0, 400.0)[i % 3]
        right = _case("wrong substrate", f"{film} {depth:g} nm", SETTINGS[i % 2], (Layer(film, depth),), seed)
        stated = "BK7" if right.stated == "Si" else ("SF10/HOYA" if i % 4 == 1 else "Si")
        found.append(replace(right, stated=stated, expected="mistake"))
        film, depth = FILMS[(i + 3) % 13], (120.0, 300.0)[i % 2]
        right = _case("wrong reference", f"{film} {depth:g} nm", SETTINGS[0], (Layer(film, depth),), seed)
        found.append(replace(right, expected="mistake", reference=("Si", "Al")[i % 2]))
    return found


def absorbs(case: Case) -> bool:
    """True for films that absorb visible light."""
    return any(layer.material in ABSORBING for layer in case.specimen.layers)
