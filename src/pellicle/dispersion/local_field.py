"""Bound charges in the local field of their neighbours: the harmonic oscillators of wafer metrology."""

import math
from typing import Any, ClassVar, final

from pellicle.dispersion.base import HC, AbstractDispersion, require_nonnegative
from pellicle.optics import pair
from pellicle.optics.pair import Pair, imag, namespace, real

PLASMA = 1.3788422923
"""Square of the plasma energy of one electron per nm³ (eV² nm³): ħ²e²/(ε₀m) = 16π Ry² a₀³, CODATA 2018."""


@final
class HarmonicOscillators(AbstractDispersion):
    """ε = 1 + ΣH/(1 − Σ nu H), H = 16π Ry² a₀³ N exp(i phase)/(E² − E_photon² − i gamma E_photon).

    `nu` is 1/3 in the local field of a cubic medium (H. Lorentz and L. Lorenz; Born and Wolf, Principles of
    Optics, sections 2.3.3 and 2.3.4) and 0 without it. `N` counts electrons per nm³, `E` and `gamma` are in
    eV, `phase` in degrees; each is a tuple with one number for each oscillator. Where a phase makes k
    negative it counts as 0, and n stays. With equal `nu` and without phases it obeys Kramers and Kronig.
    """

    units: ClassVar = {"N": "nm^-3", "E": "eV", "gamma": "eV", "phase": "deg"}
    N: tuple[Any, ...]
    E: tuple[Any, ...]
    gamma: tuple[Any, ...]
    nu: tuple[Any, ...]
    phase: tuple[Any, ...]

    def __check_init__(self):
        several = {key: getattr(self, key) for key in (*self.units, "nu")}
        if len({len(values) for values in several.values()}) != 1 or not self.N:
            raise ValueError(
                f"harmonic-oscillators: {', '.join(several)} need one number for each, at least one"
            )
        positive = {f"{key}{i}": x for key in ("N", "E", "gamma") for i, x in enumerate(several[key], 1)}
        require_nonnegative("harmonic-oscillators", **positive)

    def index(self, wavelength):
        energy = HC / wavelength
        polarised, field = Pair(0.0, 0.0), Pair(0.0, 0.0)
        for n, centre, gamma, nu, phase in zip(self.N, self.E, self.gamma, self.nu, self.phase, strict=True):
            xp, turn = namespace(phase), phase * (math.pi / 180)
            share = Pair(xp.cos(turn), xp.sin(turn)) * (PLASMA * n)
            share = share / Pair(centre * centre - energy * energy, -gamma * energy)
            polarised, field = polarised + share, field + share * nu
        epsilon = polarised / (1.0 - field) + 1.0
        loss = imag(epsilon)
        xp = namespace(loss)
        root = pair.sqrt(Pair(real(epsilon), xp.where(loss < 0, -loss, loss)))
        return Pair(real(root), xp.where(loss < 0, 0.0, imag(root)))
