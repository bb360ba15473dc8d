"""Optical response of coherent layers to one polarisation: amplitudes over a common denominator."""

from typing import Any, NamedTuple

from pellicle.optics.pair import Number


class Amplitudes(NamedTuple):
    """One quantity each of the reflection from above, the reflection from below and their denominator."""

    reflected: Any
    below: Any
    denominator: Any


class Response(NamedTuple):
    """Amplitudes of one polarisation, their squared moduli, and the factors of the transmitted power."""

    reflected: Number  # r = reflected / denominator, for light from the ambient
    below: Number  # r′ = below / denominator, for light from the substrate
    denominator: Number
    squares: Amplitudes  # squared moduli of the three
    flux: Any  # power into the substrate: T = flux · scale_square / squares.denominator
    scale_square: Any  # |scale|² of the layers' matrix elements, see `pellicle.optics.characteristic`


def reflectance(*responses: Response) -> Any:
    """Return R = |r|² for light from the ambient, the mean over the polarisations."""
    share = 1 / len(responses)
    return sum(x.squares.reflected * (share / x.squares.denominator) for x in responses)


def reflectance_below(response: Response) -> Any:
    """Return R′ = |r′|² for light from the substrate."""
    return response.squares.below / response.squares.denominator


def transmittance(*responses: Response) -> Any:
    """Return T, the power into the substrate, the mean over the polarisations.

    Between media that do not absorb, light from the substrate has the same T.
    """
    share = 1 / len(responses)
    return responses[0].scale_square * sum(x.flux * (share / x.squares.denominator) for x in responses)
