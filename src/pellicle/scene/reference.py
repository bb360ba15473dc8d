"""Reference of a measurement: a known sample, with whose reflectance that of the film is compared."""

from __future__ import annotations

from typing import final

import equinox as eqx

from pellicle.errors import UsageError
from pellicle.scene.free import free_leaves
from pellicle.scene.layers import Interface, Layer, Plate, Substrate
from pellicle.signals.contrast import FORMS


@final
class Reference(eqx.Module):
    """A known sample: a substrate, bare or below layers.

    **Arguments:** `substrate`: a `Substrate`, or its material; `layers` from the ambient down; `form` of a
    contrast against it: "relative", (R − R₀)/R₀, or "normalised", (R − R₀)/(R + R₀).

    **Raises:** UsageError for another form, and for free parameters.

    >>> Reference("Si", [Layer("SiO2", 285.0)]).form
    'relative'
    """

    substrate: Substrate = eqx.field(converter=lambda s: s if isinstance(s, Substrate) else Substrate(s))
    layers: tuple[Layer | Interface | Plate, ...] = eqx.field(
        converter=lambda x: tuple(x) if isinstance(x, list | tuple) else (x,), default=()
    )
    form: str = eqx.field(static=True, default="relative")

    def __check_init__(self):
        if self.form not in FORMS:
            raise UsageError(f"`form` must be one of {', '.join(FORMS)}, not {self.form!r}")
        if free_leaves((self.substrate, self.layers)):
            raise UsageError("a `reference` is known: give its thicknesses and indices as plain numbers")
