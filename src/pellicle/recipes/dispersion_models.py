"""Dispersion models by name: their parameters, default bounds and values, and how to build them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from pellicle.dispersion import critical_points, oscillators
from pellicle.dispersion.anisotropic import ParameterLocation
from pellicle.dispersion.base import AbstractDispersion, require_nonnegative
from pellicle.dispersion.empirical import Cauchy, CauchyUrbach, Constant, Sellmeier
from pellicle.dispersion.forouhi_bloomer import ForouhiBloomer, NewAmorphous
from pellicle.dispersion.local_field import HarmonicOscillators
from pellicle.dispersion.phonons import Gervais
from pellicle.dispersion.psemi import Psemi
from pellicle.dispersion.spline import KramersKronigSpline, Spline
from pellicle.errors import UsageError
from pellicle.scene.free import Free, is_free
from pellicle.scene.ties import Tied

Parameter: TypeAlias = float | Free | Tied
Values: TypeAlias = Mapping[str, "Parameter | np.ndarray | Sequence[Parameter]"]
"""Parameters of a model by name, of several at once as arrays; of a spline one or one per knot, and its
`knots` (nm)."""


class ParameterSpec(NamedTuple):
    """A model's parameter: default bounds, default value, and whether the model's bare name frees it.

    A fit whose best value lies on a default bound may widen the bounds up to `limits`: what physics allows,
    or what no known film in the infrared to ultraviolet exceeds.
    """

    lower: float
    upper: float
    value: float
    limits: tuple[float, float]
    free: bool = True

    def parameter(self, start: float | None) -> Free:
        """The parameter free within its default bounds; None starts in their middle."""
        return Free(self.lower, self.upper, start=start, limits=self.limits)


# A is the index at long waves: at least that of vacuum, at most a little above that of germanium (4.0), which
# few films exceed (lead telluride, 5.7). Where nothing is absorbed n falls with wavelength (Landau and
# Lifshitz, Electrodynamics of Continuous Media, section 84): no transparent film has B < 0. Of the films of
# `benchmarks/verdicts` with flawed data only those of wrong scenes rest on B = 0; a negative B lowers their
# misfit (χ² to a third) and makes no thickness right. B of silicon is 1.5e5 nm^2, of germanium 4e5.
_CAUCHY = {
    "A": ParameterSpec(1.2, 3.0, 1.5, (1.0, 4.5)),
    "B": ParameterSpec(0.0, 1e5, 0.0, (0.0, 5e5)),
    "C": ParameterSpec(-1e10, 1e10, 0.0, (-1e12, 1e12), False),
}
# the index of silicon is 12**0.5 far below its band gap, that of germanium 16**0.5
_EPS_INF = ParameterSpec(1.0, 6.0, 1.0, (1.0, 40.0))
# energies from the far infrared (62 um) to the vacuum ultraviolet
_ENERGY, _WIDTH = (0.02, 20.0), (0.001, 20.0)
_TAUC_LORENTZ = {
    "A": ParameterSpec(0.0, 300.0, 100.0, (0.0, 1000.0)),
    "E0": ParameterSpec(2.0, 8.0, 4.0, _ENERGY),
    "C": ParameterSpec(0.2, 6.0, 2.0, _WIDTH),
    "Eg": ParameterSpec(0.5, 5.0, 2.0, (0.0, 12.0)),
}

TERMS: dict[str, dict[str, ParameterSpec]] = {
    "lorentz": {
        "A": ParameterSpec(0.0, 10.0, 1.0, (0.0, 100.0)),
        "E0": ParameterSpec(1.0, 10.0, 4.0, _ENERGY),
        "gamma": ParameterSpec(0.01, 4.0, 0.5, _WIDTH),
    },
    # the plasma energy of beryllium, with the most conduction electrons of all metals, is 19 eV
    "drude": {
        "Ep": ParameterSpec(0.0, 15.0, 3.0, (0.0, 20.0)),
        "gamma": ParameterSpec(0.01, 2.0, 0.1, _WIDTH),
    },
    "gaussian": {
        "A": ParameterSpec(0.0, 10.0, 1.0, (0.0, 100.0)),
        "E0": ParameterSpec(1.0, 10.0, 4.0, _ENERGY),
        "fwhm": ParameterSpec(0.05, 4.0, 0.5, _WIDTH),
    },
    "tauc-lorentz": _TAUC_LORENTZ,
    "cody-lorentz": {
        **_TAUC_LORENTZ,
        "Ep": ParameterSpec(0.1, 5.0, 1.0, (0.01, 20.0)),
        "Et": ParameterSpec(0.0, 1.0, 0.0, (0.0, 3.0), False),
        "Eu": ParameterSpec(0.01, 0.5, 0.05, (0.001, 2.0), False),
    },
    "drude-smith": {
        "Ep": ParameterSpec(0.0, 15.0, 3.0, (0.0, 20.0)),
        "gamma": ParameterSpec(0.01, 2.0, 0.1, _WIDTH),
        "c": ParameterSpec(-1.0, 0.0, -0.5, (-1.0, 0.0)),
    },
    # above the spectrum of nearly every instrument, 6.5 eV at 190 nm, and below it
    "uv-pole": {
        "A": ParameterSpec(0.0, 300.0, 50.0, (0.0, 1000.0)),
        "E0": ParameterSpec(7.0, 15.0, 10.0, (6.6, 50.0)),
    },
    "ir-pole": {"A": ParameterSpec(0.0, 2.0, 0.1, (0.0, 100.0))},
    "critical-point": {
        "A": ParameterSpec(0.0, 10.0, 1.0, (0.0, 100.0)),
        "E0": ParameterSpec(1.0, 10.0, 4.0, _ENERGY),
        "gamma": ParameterSpec(0.01, 4.0, 0.5, _WIDTH),
        "phase": ParameterSpec(-90.0, 90.0, 0.0, (-180.0, 180.0)),
        "mu": ParameterSpec(0.25, 2.0, 1.0, (0.05, 4.0), False),
    },
    "cppb": {
        "A": ParameterSpec(0.0, 20.0, 2.0, (0.0, 100.0)),
        "E0": ParameterSpec(1.0, 10.0, 4.0, _ENERGY),
        "gamma": ParameterSpec(0.02, 4.0, 0.5, _WIDTH),
        "phase": ParameterSpec(-90.0, 90.0, 0.0, (-180.0, 180.0)),
        "mu": ParameterSpec(-1.0, 2.0, 1.0, (-1.0, 4.0), False),
    },
    "adachi-m0": {
        "A": ParameterSpec(0.0, 100.0, 5.0, (0.0, 1000.0)),
        "E0": ParameterSpec(1.0, 8.0, 3.0, _ENERGY),
        "gamma": ParameterSpec(0.001, 1.0, 0.1, (0.0001, 20.0)),
    },
    "adachi-m1": {
        "A": ParameterSpec(0.0, 10.0, 2.0, (0.0, 100.0)),
        "E0": ParameterSpec(1.0, 8.0, 3.0, _ENERGY),
        "gamma": ParameterSpec(0.001, 1.0, 0.1, (0.0001, 20.0)),
    },
    # the exciton of GaAs is bound by 4 meV, that of ZnO by 60 meV, of layered crystals by up to 0.5 eV
    "tanguy": {
        "A": ParameterSpec(0.0, 50.0, 5.0, (0.0, 500.0)),
        "Eg": ParameterSpec(1.0, 6.0, 3.0, (0.1, 20.0)),
        "R": ParameterSpec(0.005, 0.3, 0.05, (0.0005, 2.0)),
        "gamma": ParameterSpec(0.005, 0.5, 0.05, _WIDTH),
    },
    "brendel-bormann": {
        "A": ParameterSpec(0.0, 50.0, 5.0, (0.0, 1000.0)),
        "E0": ParameterSpec(1.0, 10.0, 4.0, _ENERGY),
        "gamma": ParameterSpec(0.0, 2.0, 0.1, (0.0, 20.0)),
        "sigma": ParameterSpec(0.02, 2.0, 0.3, _WIDTH),
    },
    "psemi": {
        "A": ParameterSpec(0.0, 30.0, 5.0, (0.0, 200.0)),
        "E0": ParameterSpec(1.0, 8.0, 4.0, _ENERGY),
        "fwhm": ParameterSpec(0.02, 1.0, 0.2, (0.001, 20.0)),
        "WL": ParameterSpec(0.2, 4.0, 1.0, (0.01, 10.0)),
        "WR": ParameterSpec(0.2, 4.0, 1.0, (0.01, 10.0)),
        **dict.fromkeys(("PL", "PR"), ParameterSpec(0.1, 0.9, 0.5, (0.01, 0.99), False)),
        **dict.fromkeys(("AL", "AR"), ParameterSpec(0.0, 1.0, 0.5, (0.0, 2.0), False)),
        **dict.fromkeys(("OL", "OR"), ParameterSpec(-1.0, 1.0, 0.0, (-1.0, 1.0), False)),
    },
}
"""Oscillators and their parameters; energies in eV, the strength A of lorentz and gaussian without unit."""


def _numbered(
    count: int, specs: Mapping[str, ParameterSpec], more: Mapping[str, float]
) -> dict[str, ParameterSpec]:
    """Parameters of `count` parts: the first free, the others with values `more`, which add nothing."""
    others = {key: spec._replace(value=more.get(key, spec.value), free=False) for key, spec in specs.items()}
    return {f"{key}{i}": x for i in range(1, count + 1) for key, x in (specs if i == 1 else others).items()}


_AMORPHOUS = {
    "n_inf": ParameterSpec(1.0, 3.0, 1.5, (0.5, 6.0)),
    "Eg": ParameterSpec(0.5, 6.0, 2.5, (0.0, 12.0)),
}
# from 8 cm^-1 to 2000 cm^-1; the reststrahlen bands of quartz lie at 1080 cm^-1, those of NaCl at 164 cm^-1
_PHONON, _DAMPING = (0.001, 0.25), (1e-5, 0.2)

# silver has the least n of metals (0.05), and n or k above 10 are those of metals beyond 2 um
_INDEX = {"n": ParameterSpec(1.2, 4.0, 1.5, (0.01, 10.0)), "k": ParameterSpec(0.0, 2.0, 0.01, (0.0, 20.0))}
# B of silicon is 10.7 and of germanium 15; a resonance at 800 nm, the band gap of gallium arsenide is there
_B, _C = (0.0, 40.0), (0.0, 6.4e5)
MODELS: dict[str, dict[str, ParameterSpec]] = {
    "constant": {
        "n": ParameterSpec(1.2, 4.0, 1.5, (1.0, 5.0)),
        "k": ParameterSpec(0.0, 2.0, 0.0, (0.0, 20.0), False),
    },
    "cauchy": _CAUCHY,
    "cauchy-urbach": {
        **_CAUCHY,
        # beside an absorption n may fall towards the blue
        "B": ParameterSpec(0.0, 1e5, 0.0, (-1e5, 5e5)),
        "k0": ParameterSpec(0.0, 1.0, 0.01, (0.0, 5.0)),
        "Eu": ParameterSpec(0.05, 2.0, 0.5, (0.005, 10.0)),
        "Eb": ParameterSpec(1.0, 6.0, 3.1, (1.0, 6.0), False),
    },
    "sellmeier": {
        "B1": ParameterSpec(0.1, 6.0, 1.1, _B),
        "C1": ParameterSpec(0.0, 6e4, 8e3, _C),
        "B2": ParameterSpec(0.0, 6.0, 0.0, _B, False),
        "C2": ParameterSpec(0.0, 6e4, 2e4, _C, False),
        "B3": ParameterSpec(0.0, 6.0, 0.0, _B, False),
        "C3": ParameterSpec(1e6, 1e9, 1e8, (6.4e5, 1e10), False),
    },
    "new-amorphous": {
        **_AMORPHOUS,
        **_numbered(
            4,
            {
                "f": ParameterSpec(0.0, 1.0, 0.1, (0.0, 10.0)),
                "E": ParameterSpec(2.0, 10.0, 5.0, _ENERGY),
                "gamma": ParameterSpec(0.2, 5.0, 1.0, (0.01, 20.0)),
            },
            {"f": 0.0},
        ),
    },
    "forouhi-bloomer": {
        **_AMORPHOUS,
        **_numbered(
            4,
            {
                "A": ParameterSpec(0.0, 1.0, 0.1, (0.0, 10.0)),
                "B": ParameterSpec(4.0, 20.0, 10.0, (0.04, 40.0)),
                "C": ParameterSpec(4.0, 125.0, 26.0, (0.0, 800.0)),
            },
            {"A": 0.0},
        ),
    },
    "gervais": {
        "eps_inf": _EPS_INF,
        **_numbered(
            8,
            {
                "TO": ParameterSpec(0.03, 0.2, 0.1, _PHONON),
                "gamma_TO": ParameterSpec(0.0005, 0.02, 0.002, _DAMPING),
                "LO": ParameterSpec(0.03, 0.22, 0.12, _PHONON),
                "gamma_LO": ParameterSpec(0.0005, 0.02, 0.003, _DAMPING),
            },
            {"LO": 0.1, "gamma_LO": 0.002},
        ),
    },
    # a density is that of the valence electrons: silicon has 200 per nm³, diamond 705
    "harmonic-oscillators": _numbered(
        8,
        {
            "N": ParameterSpec(0.0, 500.0, 150.0, (0.0, 3000.0)),
            "E": ParameterSpec(1.0, 20.0, 12.0, (0.0, 50.0)),
            "gamma": ParameterSpec(0.0, 5.0, 0.5, (0.0, 1000.0)),
            "nu": ParameterSpec(0.0, 1.0, 0.333333, (0.0, 1.0), False),
            "phase": ParameterSpec(-180.0, 180.0, 0.0, (-180.0, 180.0), False),
        },
        {"N": 0.0},
    ),
    **{name: {**specs, "eps_inf": _EPS_INF} for name, specs in TERMS.items()},
    "spline": _INDEX,
    "spline-kk": {
        "k": _INDEX["k"],
        "n_inf": ParameterSpec(1.0, 3.0, 1.5, (1.0, 6.0)),
        # 9 eV² from below 1.6 eV and 35 from above 4.1 eV in silver and silicon, less in oxides
        "A_uv": ParameterSpec(0.0, 20.0, 0.0, (0.0, 100.0)),
        "A_ir": ParameterSpec(0.0, 2.0, 0.0, (0.0, 100.0)),
    },
}
"""Dispersion models by name. Lengths in nm (Cauchy's B in nm², C in nm⁴, Sellmeier's C1 in nm²),
energies in eV. `spline` has one n and one k at each knot."""

SPLINES = ("spline", "spline-kk")

SERIES = {
    "sellmeier": ("B", "C"),
    "new-amorphous": ("f", "E", "gamma"),
    "forouhi-bloomer": ("A", "B", "C"),
    "gervais": ("TO", "gamma_TO", "LO", "gamma_LO"),
    "harmonic-oscillators": ("N", "E", "gamma", "nu", "phase"),
}
"""Fields with one number for each part of a model, whose parameters are `B1`, `C1`, `B2` and so on."""

KNOTS = (300.0, 400.0, 500.0, 650.0, 850.0, 1100.0)
"""Default knots of a spline (nm)."""


def free_model(name: str) -> AbstractDispersion:
    """Build a model with its parameters free within their default bounds."""
    # the bounds of these are narrow: their middle is as good a start as any
    middle = name in ("constant", "cauchy", "sellmeier")
    specs = {key: spec for key, spec in MODELS[name].items() if spec.free}
    return build_model(name, {k: spec.parameter(None if middle else spec.value) for k, spec in specs.items()})


def fixed_model(name: str, numbers: Sequence[float], label: str) -> AbstractDispersion:
    """Build a model from its parameters in their order, fixed; a spline from its knots, the rest free.

    Raises UsageError with `label` in front for a wrong count.
    """
    specs = MODELS[name]
    if name in SPLINES:
        free = {key: spec.parameter(spec.value) for key, spec in specs.items()}
        return build_model(name, {"knots": numbers, **free})
    if not 0 < len(numbers) <= len(specs):
        raise UsageError(
            f"{label}: {name} takes 1 to {len(specs)} numbers ({', '.join(specs)}), got {len(numbers)}"
        )
    return build_model(name, dict(zip(specs, numbers, strict=False)))


@contextmanager
def usage_errors(label: str = "") -> Iterator[None]:
    """Turn ValueErrors of dispersions and numbers into UsageErrors with `label` in front."""
    try:
        yield
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(f"{label}{error}") from None


_CAUCHY = ("cauchy", "cauchy-urbach")


@usage_errors()
def build_model(name: str, values: Values) -> AbstractDispersion:
    """Build a model of `MODELS` from `values`; other parameters are fixed at their defaults.

    Raises UsageError for values that the model forbids.
    """
    given: dict[str, Any] = {key: spec.value for key, spec in MODELS[name].items()} | dict(values)
    B = given.get("B")
    if name in _CAUCHY and isinstance(B, float | int) and 0 < abs(B) < 1:
        raise UsageError(
            f"{name}: B = {B:g} nm² changes no index, and is like one in µm²: write {1e6 * B:g}, its value in"
            " nm², or 0"
        )
    if name in TERMS:
        return oscillators.Oscillators(given.pop("eps_inf"), (KINDS[name](**given),))
    if name == "constant":
        require_nonnegative("constant", **given)
        return Constant(given["n"], None if given["k"] == 0 else given["k"])
    if name in SERIES:  # parts beyond the last one given are absent
        last = max((int(key[-1]) for key in values if key[-1].isdigit()), default=1)
        parts = {x: tuple(given.pop(f"{x}{i}") for i in range(1, last + 1)) for x in SERIES[name]}
        given = {key: x for key, x in given.items() if not key[-1].isdigit()} | parts
    if name in SPLINES:
        knots = given.setdefault("knots", KNOTS)
        if not isinstance(knots, list | tuple) or not all(isinstance(x, int | float) for x in knots):
            raise UsageError(f"{name}: knots must be a list of wavelengths in nm, got {knots!r}")
        for key in given.keys() & {"n", "k"}:
            column = given[key]
            given[key] = tuple(column) if isinstance(column, list | tuple) else (column,) * len(knots)
    return KINDS[name](**given)


@usage_errors()
def build_oscillator(kind: str, values: Values) -> oscillators.AbstractOscillator:
    """Build one oscillator of a sum. Raises UsageError as `build_model` does."""
    return KINDS[kind](**{key: spec.value for key, spec in TERMS[kind].items()} | dict(values))


def free_by_default(location: ParameterLocation, number: Parameter) -> Free | None:
    """Return a parameter free within its default bounds, else within its own; None where there are none.

    It starts at a fixed number within the bounds, else in their middle.
    """
    spec = _spec(location)
    if spec is None:
        return Free(number.lower, number.upper, limits=number.limits) if is_free(number) else None
    if not isinstance(number, int | float) or not spec.lower <= number <= spec.upper:
        return spec.parameter(None)
    return spec.parameter(number)


def _spec(location: ParameterLocation) -> ParameterSpec | None:
    if location.field == "fraction":
        return ParameterSpec(0.0, 1.0, 0.5, (0.0, 1.0))
    for name, specs in MODELS.items():
        kind = KINDS[name]
        # words free n and k of a constant with bounds around its own index
        spec = specs.get(location.key) or specs.get(location.field)
        if spec and kind is type(location.owner) and kind is not Constant:
            return spec
    return _EPS_INF if location.field == "eps_inf" else None


KINDS: dict[str, type[Any]] = {
    "constant": Constant,
    "cauchy": Cauchy,
    "cauchy-urbach": CauchyUrbach,
    "sellmeier": Sellmeier,
    "spline": Spline,
    "spline-kk": KramersKronigSpline,
    "lorentz": oscillators.Lorentz,
    "drude": oscillators.Drude,
    "gaussian": oscillators.Gaussian,
    "tauc-lorentz": oscillators.TaucLorentz,
    "cody-lorentz": oscillators.CodyLorentz,
    "drude-smith": oscillators.DrudeSmith,
    "uv-pole": oscillators.UVPole,
    "ir-pole": oscillators.IRPole,
    "critical-point": critical_points.CriticalPoint,
    "cppb": critical_points.ParabolicBand,
    "adachi-m0": critical_points.AdachiM0,
    "adachi-m1": critical_points.AdachiM1,
    "tanguy": critical_points.Tanguy,
    "brendel-bormann": critical_points.BrendelBormann,
    "psemi": Psemi,
    "new-amorphous": NewAmorphous,
    "forouhi-bloomer": ForouhiBloomer,
    "gervais": Gervais,
    "harmonic-oscillators": HarmonicOscillators,
}
"""The class of each model, and of each oscillator in `TERMS`."""
