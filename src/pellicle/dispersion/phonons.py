"""Phonons of ionic crystals: the four-parameter model of the reststrahlen bands."""

from typing import Any, ClassVar, final

from pellicle.dispersion.base import HC, AbstractDispersion, require_nonnegative
from pellicle.optics import pair
from pellicle.optics.pair import Number, Pair, imag, namespace, real


@final
class Gervais(AbstractDispersion):
    """ε = eps_inf Π (LO² − E² − i gamma_LO E)/(TO² − E² − i gamma_TO E): phonons with two dampings each.

    F. Gervais and B. Piriou, Phys. Rev. B 10, 1642 (1974). `TO`, `gamma_TO`, `LO` and `gamma_LO` of each
    phonon are in tuples, in eV (8065.54 cm⁻¹ are 1 eV). Kramers-Kronig consistent. ε₂ of one phonon is
    positive everywhere if gamma_LO ≥ gamma_TO and gamma_LO TO² ≤ gamma_TO LO²; where it is negative it counts
    as 0.
    """

    units: ClassVar = dict.fromkeys(("TO", "gamma_TO", "LO", "gamma_LO"), "eV")
    kramers_kronig: ClassVar = True
    eps_inf: Any
    TO: tuple[Any, ...]
    gamma_TO: tuple[Any, ...]
    LO: tuple[Any, ...]
    gamma_LO: tuple[Any, ...]

    def __check_init__(self):
        several = [getattr(self, name) for name in self.units]
        if len({len(values) for values in several}) != 1 or not self.TO:
            raise ValueError(
                f"gervais: {', '.join(self.units)} need one number for each phonon, and one at least"
            )
        numbered = {f"{key}{i}": x for key in self.units for i, x in enumerate(getattr(self, key), 1)}
        require_nonnegative("gervais", eps_inf=self.eps_inf, **numbered)

    def index(self, wavelength):
        energy = HC / wavelength
        square = energy * energy
        epsilon: Number = self.eps_inf
        for to, to_loss, lo, lo_loss in zip(self.TO, self.gamma_TO, self.LO, self.gamma_LO, strict=True):
            zero = Pair(lo * lo - square, -lo_loss * energy)
            epsilon = epsilon * zero / Pair(to * to - square, -to_loss * energy)
        loss = imag(epsilon)
        return pair.sqrt(Pair(real(epsilon), namespace(loss).where(loss < 0, 0.0, loss)))
