"""Priors of free parameters, each in the parameter's own unit."""

from typing import TypeAlias, final

import equinox as eqx


@final
class Normal(eqx.Module):
    """Normal prior, truncated at the parameter's bounds.

    **Arguments:** `mean` and standard deviation `sd`. **Raises:** ValueError unless `sd` is positive.

    >>> Normal(100.0, 5.0).mean_and_weight
    (100.0, 0.2)
    """

    mean: float = eqx.field(static=True)
    sd: float = eqx.field(static=True)

    def __check_init__(self):
        _check_sd(self.sd)

    @property
    def mean_and_weight(self) -> tuple[float, float]:
        """Mean, and the weight 1/sd of the residual (value − mean) in least squares."""
        return self.mean, 1 / self.sd

    def check(self, lower: float, upper: float) -> None:
        """Raise ValueError where the mean is outside the bounds."""
        if not lower <= self.mean <= upper:
            raise ValueError(f"the prior's mean {self.mean:g} is outside the bounds {lower:g} to {upper:g}")


@final
class HalfNormal(eqx.Module):
    """Normal prior around zero of a parameter that is never negative, such as a roughness.

    **Arguments:** standard deviation `sd` of the whole normal. **Raises:** ValueError unless it is positive.
    """

    sd: float = eqx.field(static=True)

    def __check_init__(self):
        _check_sd(self.sd)

    @property
    def mean_and_weight(self) -> tuple[float, float]:
        """Zero, and the weight 1/sd of the residual in least squares."""
        return 0.0, 1 / self.sd

    def check(self, lower: float, upper: float) -> None:
        """Raise ValueError unless the bounds include 0 and values above it."""
        if not lower <= 0 < upper:
            raise ValueError(f"a half-normal prior starts at 0, outside the bounds {lower:g} to {upper:g}")


@final
class LogUniform(eqx.Module):
    """Prior that is uniform in the logarithm of the parameter, whose bounds must be positive.

    It acts on posteriors only: the best fit maximises the likelihood in the logarithm, where it is flat.
    """

    @property
    def mean_and_weight(self) -> tuple[float, float]:
        """Zeros: least squares has no residual for it."""
        return 0.0, 0.0

    def check(self, lower: float, upper: float) -> None:
        """Raise ValueError unless the lower bound is above 0."""
        if not lower > 0:
            raise ValueError(f"a log-uniform prior needs a lower bound above 0, not {lower:g}")


Prior: TypeAlias = Normal | HalfNormal | LogUniform


def _check_sd(sd: float) -> None:
    if not sd > 0:
        raise ValueError(f"a prior's standard deviation must be positive, not {sd}")
