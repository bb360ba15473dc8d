"""Response of any number of coherent layers: the closed form of a film, or characteristic matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pellicle.optics.anisotropy import Principal, mixes_polarisations, seen_by
from pellicle.optics.few_layers import FEW, few_layers
from pellicle.optics.film import film
from pellicle.optics.gradient import is_graded
from pellicle.optics.pair import Number
from pellicle.optics.response import Response
from pellicle.optics.stack import stack


def responses(
    ambient: Number,
    layers: Sequence[Number],
    substrate: Number,
    phases: Sequence[Any],
    angle: Any = None,
    polarisations: str = "sp",
    *,
    propagating: bool = False,
    roughness: Sequence[Any] | None = None,
) -> tuple[Response, ...]:
    """Return the response of coherent layers between two half spaces, for each polarisation.

    One smooth layer takes the closed form of `pellicle.optics.film`; none, two or three of them take their
    product of matrices in `pellicle.optics.few_layers`; more, or rough interfaces, take the loop of
    `pellicle.optics.stack`.

    **Arguments:** all arrays broadcast.

    - `ambient`, `substrate`: refractive indices, or `Principal` ones of a medium with its axes along those of
      the laboratory. A real index promises that the wave propagates there;
      `interface.allow_tunnelling` turns it into one that may be totally reflected. The ambient is real,
      except for light from within a plate.
    - `layers`: refractive indices from the ambient down, or `Principal` ones. In a real one the wave may be
      evanescent. A graded layer is a `pellicle.optics.gradient.Gradient`.
    - `phases`: k₀d = 2πd/λ of each layer.
    - `angle`: of incidence in radians, or `interface.Inside` for light from within a plate. None is
      normal incidence, where s and p are equal and only the first polarisation is computed.
    - `polarisations`: "s", "p" or "sp".
    - `propagating`: promises that no wave is totally reflected in a real layer: a cheaper film.
    - `roughness`: k₀σ of each interface from the top down, one more than there are layers.

    **Returns:** one `Response` for each polarisation, in their order. With a `Principal` medium s and p
    differ at normal incidence too, and each of `polarisations` has its own.

    ```python
    >>> from pellicle.optics.response import reflectance
    >>> round(float(reflectance(*responses(1.0, [1.38], 1.52, [1.138]))), 4)
    0.0126

    ```
    """
    if mixes_polarisations(ambient, *layers, substrate):
        raise ValueError("s and p mix where an optic axis is tilted: take pl.jones or pl.mueller, or a scene")
    if any(isinstance(n, Principal) for n in (ambient, *layers, substrate)):
        return tuple(
            _responses(*_seen(ambient, layers, substrate, one), phases, angle, one, propagating, roughness)[0]
            for one in polarisations
        )
    return _responses(ambient, layers, substrate, phases, angle, polarisations, propagating, roughness)


def _seen(ambient: Any, layers: Any, substrate: Any, polarisation: str) -> tuple[Any, list[Any], Any]:
    own = [seen_by(n, polarisation) for n in (ambient, *layers, substrate)]
    return own[0], own[1:-1], own[-1]


def _responses(
    ambient: Any,
    layers: Sequence[Any],
    substrate: Any,
    phases: Sequence[Any],
    angle: Any,
    polarisations: str,
    propagating: bool,
    roughness: Sequence[Any] | None,
) -> tuple[Response, ...]:
    if is_graded(layers):
        return stack(ambient, layers, substrate, phases, angle, polarisations, roughness)
    if len(layers) == 1 and roughness is None:
        return film(ambient, layers[0], substrate, phases[0], angle, polarisations, propagating)
    if len(layers) <= FEW and roughness is None:
        return few_layers(ambient, layers, substrate, phases, angle, polarisations, propagating)
    return stack(ambient, layers, substrate, phases, angle, polarisations, roughness)
