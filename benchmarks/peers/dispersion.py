"""Permittivities of dispersion models that pyElli, PyMoosh or solcore have too, and their 50 digits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mpmath import mp, mpc, mpf
from packages import PYELLI, Package

PACKAGES = (
    Package("dispersion_pellicle", "pellicle", (), "`pl.dispersion`, float64"),
    Package("dispersion_pyelli", "pyElli", PYELLI, "its poles are of the other sign in the infrared"),
    Package("dispersion_pymoosh", "PyMoosh", ("pymoosh",), "its hc is that of CODATA 2010"),
    Package(
        "dispersion_solcore", "solcore", ("solcore",), "`Custom_CPPB`, without energy-dependent broadening"
    ),
)
HC = 1239.841984
"""CODATA 2018, eV nm."""
GAAS, INP = {"A": 3.45, "E0": 1.42, "E0_d0": 1.77, "gamma": 0.02}, {"E1": 3.17, "E1_d1": 3.29, "gamma": 0.094}
GOLD = ((0.054, 0.218, 0.074, 0.742), (0.05, 2.885, 0.035, 0.349), (0.312, 4.069, 0.083, 0.83))
"""Strength, energy, damping and scatter of three resonances of gold, A. Rakić and others (1998)."""
ZNO = {"A": 7.27, "Eg": 3.4, "R": 0.06, "gamma": 0.05}
MODELS: dict[str, dict[str, Any]] = {
    "exciton of ZnO (tanguy)": {"model": "tanguy", **ZNO},
    "uv-pole and ir-pole": {"model": "poles", "A_uv": 30.0, "E_uv": 8.0, "A_ir": 0.1},
    "gold (brendel-bormann, drude)": {"model": "gold", "plasma": 9.03, "f0": 0.77, "gamma0": 0.05},
    "E₀ and E₀ + Δ₀ of GaAs (adachi-m0)": {"model": "adachi-m0", **GAAS},
    "E₁ and E₁ + Δ₁ of InP (adachi-m1)": {"model": "adachi-m1", "B1": 4.93, "B1s": 0.5, **INP},
}
"""Parameters of each case, energies in eV."""
HAVE = {
    "dispersion_pyelli": ("tanguy", "poles"),
    "dispersion_pymoosh": ("gold",),
    "dispersion_solcore": ("adachi-m0", "adachi-m1"),
}
"""Models of each package; pellicle has all."""
NM = (350.0, 500.0, 800.0)


def cases_and_truths() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return {case: parameters} and {case: real and imaginary parts of ε at `NM`}."""
    cases = {name: {"wavelength": NM, "gold": GOLD, **case} for name, case in MODELS.items()}
    for case in cases.values():
        case["packages"] = [
            p.adapter for p in PACKAGES if case["model"] in HAVE.get(p.adapter, case["model"])
        ]
    truths = {}
    with mp.workdps(50):
        for name, case in cases.items():
            values = [_EPSILON[case["model"]](case, mpf(HC) / nm) for nm in NM]
            parts = {"re": [float(mp.re(x)) for x in values], "im": [float(mp.im(x)) for x in values]}
            truths[name] = {"values": parts}
    return cases, truths


def _tanguy(case: Mapping[str, Any], energy: mpf) -> mpc:
    """C. Tanguy, Phys. Rev. Lett. 75, 4090 (1995)."""

    def g(z: mpc) -> mpc:
        xi = mp.sqrt(case["R"] / (case["Eg"] - z))
        return 2 * mp.log(xi) - 2 * mp.pi * mp.cot(mp.pi * xi) - 2 * mp.digamma(xi) - 1 / xi

    z = energy + 1j * mpf(case["gamma"])
    return 1 + case["A"] * mp.sqrt(case["R"]) / z**2 * (g(z) + g(-z) - 2 * g(mpf(0)))


def _gold(case: Mapping[str, Any], energy: mpf) -> mpc:
    """A. Rakić and others, Appl. Opt. 37, 5271 (1998)."""
    total = 1 - mpf(case["f0"]) * case["plasma"] ** 2 / (energy**2 + 1j * energy * mpf(case["gamma0"]))
    for f, centre, gamma, sigma in case["gold"]:
        a, width = mp.sqrt(energy**2 + 1j * energy * mpf(gamma)), mp.sqrt(2) * sigma
        w = [mp.exp(-z * z) * mp.erfc(-1j * z) for z in ((a - centre) / width, (a + centre) / width)]
        total += 1j * mp.sqrt(mp.pi) * f * mpf(case["plasma"]) ** 2 / (2 * a * width) * (w[0] + w[1])
    return total


def _adachi_m0(case: Mapping[str, Any], energy: mpf) -> mpc:
    """S. Adachi, Phys. Rev. B 35, 7454 (1987), E₀ and E₀ + Δ₀."""
    total = mpc(0)
    for weight, gap in ((mpf(1), case["E0"]), (mpf(1) / 2, case["E0_d0"])):
        x = (energy + 1j * mpf(case["gamma"])) / gap
        total += weight * case["A"] * mpf(gap) ** -1.5 * (2 - mp.sqrt(1 + x) - mp.sqrt(1 - x)) / x**2
    return total


def _adachi_m1(case: Mapping[str, Any], energy: mpf) -> mpc:
    """S. Adachi, Phys. Rev. B 35, 7454 (1987), E₁ and E₁ + Δ₁."""
    total = mpc(0)
    for strength, gap in ((case["B1"], case["E1"]), (case["B1s"], case["E1_d1"])):
        x = (energy + 1j * mpf(case["gamma"])) / gap
        total -= strength * mp.log(1 - x**2) / x**2
    return total


_EPSILON = {
    "tanguy": _tanguy,
    "gold": _gold,
    "adachi-m0": _adachi_m0,
    "adachi-m1": _adachi_m1,
    "poles": lambda x, e: x["A_uv"] / (mpf(x["E_uv"]) ** 2 - e**2) - x["A_ir"] / e**2,
}
