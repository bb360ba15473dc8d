"""Index as a function of temperature: thermo-optic terms of glasses, and tables at several temperatures."""

import itertools
from typing import Any, ClassVar, final

import equinox as eqx
import jax.numpy as jnp

from pellicle.dispersion.anisotropic import require_isotropic
from pellicle.dispersion.base import AbstractDispersion, bounds_of
from pellicle.optics.pair import imag, is_real, namespace, narrow, real


@final
class ThermoOptic(AbstractDispersion):
    """A medium at another `temperature`: its n plus Schott's change of the absolute index, plus dn_dT ΔT.

    Δn = (n² − 1)/(2n) [D0 ΔT + D1 ΔT² + D2 ΔT³ + (E0 ΔT + E1 ΔT²)/(λ² − lambda_TK²)] + dn_dT ΔT, with
    ΔT = `temperature` − `reference` in K and λ in µm: the coefficients are those of the glass catalogues
    (Schott, technical information TIE-19). k is unchanged. All terms are 0 by default; without
    D0 to E1 it is a constant slope `dn_dT` in 1/K. The `reference` is the temperature of `base`, 20 °C.
    """

    units: ClassVar = {
        **{"temperature": "degC", "dn_dT": "1/K", "D0": "1/K", "D1": "1/K^2", "D2": "1/K^3"},
        **{"E0": "um^2/K", "E1": "um^2/K^2", "lambda_TK": "um"},
    }
    base: AbstractDispersion
    temperature: Any
    reference: float = eqx.field(static=True, default=20.0, converter=float)
    dn_dT: Any = 0.0
    D0: Any = 0.0
    D1: Any = 0.0
    D2: Any = 0.0
    E0: Any = 0.0
    E1: Any = 0.0
    lambda_TK: Any = 0.0

    def __check_init__(self):
        require_isotropic(self.base, "thermo-optic: a temperature is that of")

    def index(self, wavelength):
        base = self.base.index(wavelength)
        n, micrometres, t = real(base), wavelength * 1e-3, self.temperature - self.reference
        pole = (self.E0 + self.E1 * t) / (micrometres * micrometres - self.lambda_TK * self.lambda_TK)
        relative = t * (self.D0 + t * (self.D1 + t * self.D2) + pole)
        changed = n + 0.5 * (n - 1 / n) * relative + self.dn_dT * t
        return narrow(changed, None if is_real(base) else imag(base))


@final
class AtTemperature(AbstractDispersion):
    """Media at rising `temperatures` (°C, fixed), n and k interpolated linearly to `temperature`.

    `media`, two or more, are dispersions of any kind, such as tables of a material at each temperature. The
    temperature must lie between the first and the last: beyond them n + ik is NaN, never an extrapolation.
    """

    units: ClassVar = {"temperature": "degC"}
    temperatures: tuple[float, ...] = eqx.field(static=True, converter=lambda x: tuple(map(float, x)))
    media: tuple[AbstractDispersion, ...] = eqx.field(converter=tuple)
    temperature: Any

    def __check_init__(self):
        t = self.temperatures
        if len(t) < 2 or any(a >= b for a, b in itertools.pairwise(t)):
            raise ValueError(f"temperatures must be two or more that rise, got {list(t)}")
        if len(self.media) != len(t):
            raise ValueError(f"temperatures: {len(t)} need as many media, got {len(self.media)}")
        for medium in self.media:
            require_isotropic(medium, "a temperature is that of")
        bounds = bounds_of(self.temperature)
        if bounds is not None and not t[0] <= bounds[0] <= bounds[1] <= t[-1]:
            wrong = bounds[0] if bounds[0] < t[0] else bounds[1]
            raise ValueError(
                f"temperature must lie in {t[0]:g} to {t[-1]:g} °C, those of the media, got {wrong:g}"
            )

    def index(self, wavelength):
        xp, t = namespace(self.temperature, wavelength), self.temperature
        inside = (t >= self.temperatures[0]) & (t <= self.temperatures[-1])
        total = xp.where(inside, 0.0, jnp.nan)
        for i, medium in enumerate(self.media):
            own = [float(i == j) for j in range(len(self.media))]
            weight = xp.interp(xp.asarray(t), xp.asarray(self.temperatures), xp.asarray(own))
            total = total + medium.index(wavelength) * weight
        return total
