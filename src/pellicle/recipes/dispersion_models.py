"""Dispersion models by name: their parameters, default bounds, and how each is put together."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import equinox as eqx

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.cody_lorentz import CodyLorentz
from pellicle.dispersion.empirical import Cauchy, CauchyUrbach, Sellmeier
from pellicle.dispersion.oscillators import (
    AbstractOscillator,
    Drude,
    Gaussian,
    Lorentz,
    Oscillators,
    TaucLorentz,
)
from pellicle.dispersion.parameter_names import ParameterLocation
from pellicle.dispersion.spline import KramersKronigSpline, Spline
from pellicle.errors import UsageError
from pellicle.scene.free import Free, is_free


class Own(NamedTuple):
    """A model's own parameter: default bounds, default value, and whether the bare name frees it."""

    lower: float
    upper: float
    value: float
    free: bool = True


_CAUCHY = {"A": Own(1.2, 3.0, 1.5), "B": Own(0.0, 1e5, 0.0), "C": Own(-1e10, 1e10, 0.0, False)}
_EPS_INF = Own(1.0, 6.0, 1.0)

TERMS: dict[str, tuple[type[AbstractOscillator], dict[str, Own]]] = {
    "lorentz": (Lorentz, {"A": Own(0.0, 10.0, 1.0), "E0": Own(1.0, 10.0, 4.0), "gamma": Own(0.01, 4.0, 0.5)}),
    "drude": (Drude, {"Ep": Own(0.0, 15.0, 3.0), "gamma": Own(0.01, 2.0, 0.1)}),
    "gaussian": (
        Gaussian,
        {"A": Own(0.0, 10.0, 1.0), "E0": Own(1.0, 10.0, 4.0), "fwhm": Own(0.05, 4.0, 0.5)},
    ),
    "tauc-lorentz": (
        TaucLorentz,
        {
            "A": Own(0.0, 300.0, 100.0),
            "E0": Own(2.0, 8.0, 4.0),
            "C": Own(0.2, 6.0, 2.0),
            "Eg": Own(0.5, 5.0, 2.0),
        },
    ),
    "cody-lorentz": (
        CodyLorentz,
        {
            "A": Own(0.0, 300.0, 100.0),
            "E0": Own(2.0, 8.0, 4.0),
            "C": Own(0.2, 6.0, 2.0),
            "Eg": Own(0.5, 5.0, 2.0),
            "Ep": Own(0.1, 5.0, 1.0),
            "Et": Own(0.0, 1.0, 0.0, False),
            "Eu": Own(0.01, 0.5, 0.05, False),
        },
    ),
}
"""Oscillators and their parameters; energies in eV, the strength A of lorentz and gaussian without unit."""

_INDEX = {"n": Own(1.2, 4.0, 1.5), "k": Own(0.0, 2.0, 0.01)}
MODELS: dict[str, dict[str, Own]] = {
    "cauchy": _CAUCHY,
    "cauchy-urbach": {
        **_CAUCHY,
        "k0": Own(0.0, 1.0, 0.01),
        "Eu": Own(0.05, 2.0, 0.5),
        "Eb": Own(1.0, 6.0, 3.1, False),
    },
    "sellmeier": {
        "B1": Own(0.1, 6.0, 1.1),
        "C1": Own(0.0, 6e4, 8e3),
        "B2": Own(0.0, 6.0, 0.0, False),
        "C2": Own(0.0, 6e4, 2e4, False),
        "B3": Own(0.0, 6.0, 0.0, False),
        "C3": Own(1e6, 1e9, 1e8, False),
    },
    **{name: {**own, "eps_inf": _EPS_INF} for name, (_, own) in TERMS.items()},
    "spline": _INDEX,
    "spline-kk": {"k": _INDEX["k"], "n_inf": Own(1.0, 3.0, 1.5)},
}
"""Dispersion models by name. Lengths in nm (Cauchy's B in nm², C in nm⁴, Sellmeier's C1 in nm²),
energies in eV. `spline` has one n and one k at each knot."""

KNOTS = (300.0, 400.0, 500.0, 650.0, 850.0, 1100.0)
"""Knots (nm) of a spline that was not given any."""


def bare(name: str) -> AbstractDispersion:
    """The model with its parameters free within their default bounds."""
    free = {key: Free(own.lower, own.upper, start=own.value) for key, own in MODELS[name].items() if own.free}
    if name in ("cauchy", "sellmeier"):
        # their bounds are narrow: the middle is as good a start as any
        free = {key: Free(own.lower, own.upper) for key, own in MODELS[name].items() if own.free}
    return model(name, free)


def called(name: str, numbers: list[float], what: str) -> AbstractDispersion:
    """`name(numbers)`: the parameters in their order, fixed; for a spline its knots. Raises UsageError."""
    own = MODELS[name]
    if name in ("spline", "spline-kk"):
        free = {key: Free(o.lower, o.upper, start=o.value) for key, o in own.items()}
        return model(name, {"knots": numbers, **free})
    if not 0 < len(numbers) <= len(own):
        raise UsageError(
            f"{what}: {name} takes 1 to {len(own)} numbers ({', '.join(own)}), got {len(numbers)}"
        )
    return model(name, dict(zip(own, numbers, strict=False)))


def model(name: str, given: dict[str, Any]) -> AbstractDispersion:
    """A dispersion model: `given` numbers or `Free`s, the rest fixed at their defaults.

    Raises UsageError for a name or a parameter that is none, with the nearest, and for values that
    the model forbids.
    """
    if name not in MODELS:
        raise UsageError(f"no dispersion model {name!r}{nearest(name, MODELS)}; known: {', '.join(MODELS)}")
    splines = name.startswith("spline")
    values = _filled(name, MODELS[name], given, ("knots",) if splines else ())
    return _made(lambda: _assembled(name, values, given))


def term(kind: str, given: dict[str, Any]) -> AbstractOscillator:
    """One oscillator of a sum, like `model`."""
    if kind not in TERMS:
        raise UsageError(f"no oscillator {kind!r}{nearest(kind, TERMS)}; known: {', '.join(TERMS)}")
    made, own = TERMS[kind]
    return _made(lambda: made(**_filled(kind, own, given)))


def oscillators(eps_inf: Any, terms: Iterable[Any]) -> AbstractDispersion:
    """A sum of terms."""
    return _made(lambda: Oscillators(eps_inf, tuple(terms)))


def checked(dispersion: AbstractDispersion, what: str) -> AbstractDispersion:
    """The dispersion, once more through its own checks. Raises UsageError, `what` in front."""
    try:
        for part in _modules(dispersion):
            getattr(part, "__check_init__", lambda: None)()
    except ValueError as error:
        raise UsageError(f"{what}: {error}") from None
    return dispersion


def default_bounds(at: ParameterLocation, number: Any) -> tuple[float, float] | None:
    """A parameter's default bounds, or those it has; None where there are none."""
    if at.field == "fraction":
        return 0.0, 1.0
    for name, own in MODELS.items():
        kind = TERMS[name][0] if name in TERMS else _KINDS.get(name)
        if kind is type(at.owner) and (at.key in own or at.field in own):
            found = own.get(at.key) or own[at.field]
            return found.lower, found.upper
    if at.field == "eps_inf":
        return _EPS_INF.lower, _EPS_INF.upper
    return (number.lower, number.upper) if is_free(number) else None


def nearest(word: str, known: Iterable[str], likeness: float = 0.5) -> str:
    """` (did you mean ...?)`, or nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=likeness)
    return f" (did you mean {close[0]!r}?)" if close else ""


_KINDS = {
    "cauchy": Cauchy,
    "cauchy-urbach": CauchyUrbach,
    "sellmeier": Sellmeier,
    "spline": Spline,
    "spline-kk": KramersKronigSpline,
}


def _assembled(name: str, values: dict[str, Any], given: dict[str, Any]) -> AbstractDispersion:
    if name in TERMS:
        made, own = TERMS[name]
        return Oscillators(values["eps_inf"], (made(**{key: values[key] for key in own}),))
    if name == "sellmeier":
        count = max((int(key[1]) for key in given), default=1)
        pairs = [(values[f"B{i + 1}"], values[f"C{i + 1}"]) for i in range(count)]
        return Sellmeier(tuple(b for b, _ in pairs), tuple(c for _, c in pairs))
    if not name.startswith("spline"):
        return _KINDS[name](**values)
    knots = values.pop("knots", KNOTS)
    if not isinstance(knots, list | tuple) or not all(isinstance(x, int | float) for x in knots):
        raise UsageError(f"{name}: knots must be a list of wavelengths in nm, got {knots!r}")
    columns = {key: _column(values.pop(key), len(knots)) for key in ("n", "k") if key in values}
    return _KINDS[name](knots=knots, **columns, **values)


def _column(value: Any, count: int) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, list | tuple) else (value,) * count


def _filled(
    name: str, own: dict[str, Own], given: dict[str, Any], more: tuple[str, ...] = ()
) -> dict[str, Any]:
    known = [*own, *more]
    for key in given:
        if key not in known:
            raise UsageError(
                f"{name} has no parameter {key!r}{nearest(key, known)}; it has {', '.join(known)}"
            )
    return {key: o.value for key, o in own.items()} | given


def _made(make: Callable[[], Any]) -> Any:
    try:
        return make()
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(str(error)) from None


def _modules(tree: Any) -> list[eqx.Module]:
    """Every module of a dispersion, itself included, but the free parameters."""
    if is_free(tree):
        return []
    if isinstance(tree, tuple):
        return [x for part in tree for x in _modules(part)]
    if not isinstance(tree, eqx.Module):
        return []
    return [tree, *(x for part in vars(tree).values() for x in _modules(part))]
