"""Base class of dispersions, and the bounds of their parameters."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from pellicle.optics.pair import Number, namespace, to_complex

HC = 1239.841984
"""Photon energy times wavelength, in eV nm (CODATA 2018): models in eV convert here, and only here."""


class AbstractDispersion(eqx.Module):
    """n + ik as a function of wavelength. Subclasses are final.

    `units` names the unit of each parameter that has one. `kramers_kronig` is True if n and k obey the
    Kramers-Kronig relations, of a sum if all of its terms do.
    """

    units: ClassVar[dict[str, str]] = {}
    kramers_kronig: ClassVar[bool] = False

    @abc.abstractmethod
    def index(self, wavelength: Any) -> Number:
        """Index at `wavelength` (nm, any shape): a real array, or a Pair where it may absorb."""

    def __call__(self, wavelength: Any) -> Complex[Array, "..."]:
        """n + ik as a complex array at `wavelength` (nm, any shape).

        Of numbers that are known and no arrays of JAX it is computed by NumPy, without compilation.
        """
        if any(isinstance(x, jax.Array) for x in jax.tree_util.tree_leaves((self, wavelength))):
            nm: Any = jnp.asarray(wavelength)
            return to_complex(self.index(nm.astype(jnp.result_type(float, nm))))
        nm = np.asarray(wavelength)
        return jnp.asarray(np.asarray(known_index(self, nm), complex), jnp.result_type(float, nm, 1j))


def known_index(dispersion: AbstractDispersion, wavelength: np.ndarray) -> Any:
    """Index of a dispersion of numbers at `wavelength` (nm), in NumPy arrays: nothing is compiled.

    It is not finite where the formula of a model is not.
    """
    # NumPy's numbers keep the formulas in NumPy where they combine parameters alone
    leaves, structure = jax.tree_util.tree_flatten(dispersion)
    if not all(isinstance(leaf, np.ndarray | np.generic) for leaf in leaves):
        dispersion = jax.tree_util.tree_unflatten(structure, [np.asarray(leaf)[()] for leaf in leaves])
    with np.errstate(all="ignore"):
        return jax.tree_util.tree_map(np.asarray, dispersion.index(np.asarray(wavelength, dtype=float)))


def bounds_of(number: Any) -> tuple[float, float] | None:
    """The least and the largest value of a parameter, free or fixed; None for an array or a tracer."""
    if isinstance(number, int | float):
        return number, number
    if hasattr(number, "lower") and hasattr(number, "upper"):
        return number.lower, number.upper
    return None


def require_nonnegative(model: str, **parameters: Any) -> None:
    """ValueError for a parameter that can be below zero."""
    for name, number in parameters.items():
        bounds = bounds_of(number)
        if bounds is not None and bounds[0] < 0:
            raise ValueError(f"{model}: {name} must not be negative, got {bounds[0]:g}")


def require_positive(model: str, *, unit: str = "", **parameters: Any) -> None:
    """Raise ValueError naming the first parameter whose value or lower bound is not above zero."""
    for name, number in parameters.items():
        bounds = bounds_of(number)
        if bounds is not None and not bounds[0] > 0:
            raise ValueError(f"{model}: {name} must be positive, got {bounds[0]:g}{unit}")


def cast_like(values: Any, wavelength: Any):
    """A table's column in the precision of the wavelengths, so that float32 stays float32."""
    return namespace(values, wavelength).asarray(values, dtype=jnp.result_type(float, wavelength))
