"""Amorphous and crystalline media by Forouhi and Bloomer: k of a gap and resonances, with a matching n.

n and k are given, not the permittivity, so these are whole models and no terms of a sum. They are not
Kramers-Kronig consistent: k stays finite at high energy, and n is not exactly its transform.
"""

from typing import Any, ClassVar, final

from pellicle.dispersion.base import HC, AbstractDispersion, require_nonnegative
from pellicle.optics.pair import Pair, namespace


def _of_resonances(wavelength: Any, n_inf: Any, gap: Any, resonances: Any) -> Pair:
    """n_inf + Σ [B(E − E0) + C]/[(E − E0)² + γ²] and Σ f (E − Eg)²/[...] above the gap, of (f, E0, γ)."""
    energy = HC / wavelength
    above = namespace(energy, gap).maximum(energy - gap, 0.0)
    n, k = n_inf + 0.0 * energy, 0.0 * energy
    for strength, centre, gamma in resonances:
        off, over = energy - centre, centre - gap
        scale = strength / (off * off + gamma * gamma)
        n = n + scale * ((gamma * gamma - over * over) / gamma * off + 2 * gamma * over)
        k = k + scale * above * above
    return Pair(n, k)


def _check(model: str, several: dict[str, tuple[Any, ...]], **parameters: Any) -> None:
    counts = {len(values) for values in several.values()}
    if len(counts) != 1 or counts == {0}:
        raise ValueError(
            f"{model}: {', '.join(several)} need one number for each resonance, and one at least"
        )
    numbered = {f"{key}{i}": x for key, values in several.items() for i, x in enumerate(values, 1)}
    require_nonnegative(model, **parameters, **numbered)


@final
class NewAmorphous(AbstractDispersion):
    """k = Σ f (E − Eg)²/[(E − E_j)² + γ²] above the gap Eg, 0 below; n = n_inf + Σ [B(E − E_j) + C]/[...].

    B = (f/γ)[γ² − (E_j − Eg)²], C = 2fγ(E_j − Eg). This is the formula of A. Forouhi and I. Bloomer, Phys.
    Rev. B 34, 7018 (1986), in the parameters of Horiba Jobin-Yvon's "New Amorphous", with `f`, `E`, `gamma`
    of each resonance in tuples. `f` and `n_inf` have no unit, energies are in eV.
    """

    units: ClassVar = {"Eg": "eV", "E": "eV", "gamma": "eV"}
    n_inf: Any
    Eg: Any
    f: tuple[Any, ...]
    E: tuple[Any, ...]
    gamma: tuple[Any, ...]

    def __check_init__(self):
        several = {"f": self.f, "E": self.E, "gamma": self.gamma}
        _check("new-amorphous", several, n_inf=self.n_inf, Eg=self.Eg)

    def index(self, wavelength):
        resonances = zip(self.f, self.E, self.gamma, strict=True)
        return _of_resonances(wavelength, self.n_inf, self.Eg, resonances)


@final
class ForouhiBloomer(AbstractDispersion):
    """k = (E − Eg)² Σ A/(E² − BE + C) above Eg, 0 below; n = n_inf + Σ (B₀E + C₀)/(E² − BE + C).

    B₀ = (A/Q)(−B²/2 + Eg B − Eg² + C), C₀ = (A/Q)[(Eg² + C)B/2 − 2Eg C], Q = √(4C − B²)/2. One term:
    A. Forouhi and I. Bloomer, Phys. Rev. B 34, 7018 (1986), for amorphous media; several: 38, 1865 (1988),
    for crystals. `A` has no unit, `B` is in eV, `C` in eV². C below B²/4 + 0.01, where there is no
    resonance, counts as that: to fit, `NewAmorphous` is the same with parameters that cannot leave physics.
    """

    units: ClassVar = {"Eg": "eV", "B": "eV", "C": "eV^2"}
    n_inf: Any
    Eg: Any
    A: tuple[Any, ...]
    B: tuple[Any, ...]
    C: tuple[Any, ...]

    def __check_init__(self):
        _check("forouhi-bloomer", {"A": self.A, "B": self.B, "C": self.C}, n_inf=self.n_inf, Eg=self.Eg)

    def index(self, wavelength):
        resonances = []
        for a, b, c in zip(self.A, self.B, self.C, strict=True):
            xp = namespace(b, c)
            resonances.append((a, 0.5 * b, xp.sqrt(xp.maximum(c - 0.25 * b * b, 0.01))))
        return _of_resonances(wavelength, self.n_inf, self.Eg, resonances)
