"""Dispersion: complex refractive index n + ik as a function of wavelength.

`pl.dispersion.Cauchy(1.45, 3000.0)(550.0)` evaluates a model at wavelengths in nm. Mixtures are in
`pellicle.dispersion.effective_medium`.
"""

from pellicle.dispersion.anisotropic import Anisotropic as Anisotropic
from pellicle.dispersion.base import HC as HC
from pellicle.dispersion.base import AbstractDispersion as AbstractDispersion
from pellicle.dispersion.critical_points import AdachiM0 as AdachiM0
from pellicle.dispersion.critical_points import AdachiM1 as AdachiM1
from pellicle.dispersion.critical_points import BrendelBormann as BrendelBormann
from pellicle.dispersion.critical_points import CriticalPoint as CriticalPoint
from pellicle.dispersion.critical_points import ParabolicBand as ParabolicBand
from pellicle.dispersion.critical_points import Tanguy as Tanguy
from pellicle.dispersion.effective_medium import Bruggeman as Bruggeman
from pellicle.dispersion.effective_medium import Linear as Linear
from pellicle.dispersion.effective_medium import Looyenga as Looyenga
from pellicle.dispersion.effective_medium import MaxwellGarnett as MaxwellGarnett
from pellicle.dispersion.empirical import Cauchy as Cauchy
from pellicle.dispersion.empirical import CauchyUrbach as CauchyUrbach
from pellicle.dispersion.empirical import Constant as Constant
from pellicle.dispersion.empirical import Sellmeier as Sellmeier
from pellicle.dispersion.empirical import Shifted as Shifted
from pellicle.dispersion.empirical import Table as Table
from pellicle.dispersion.empirical import WithExtinction as WithExtinction
from pellicle.dispersion.forouhi_bloomer import ForouhiBloomer as ForouhiBloomer
from pellicle.dispersion.forouhi_bloomer import NewAmorphous as NewAmorphous
from pellicle.dispersion.local_field import HarmonicOscillators as HarmonicOscillators
from pellicle.dispersion.oscillators import AbstractOscillator as AbstractOscillator
from pellicle.dispersion.oscillators import CodyLorentz as CodyLorentz
from pellicle.dispersion.oscillators import Drude as Drude
from pellicle.dispersion.oscillators import DrudeSmith as DrudeSmith
from pellicle.dispersion.oscillators import Gaussian as Gaussian
from pellicle.dispersion.oscillators import IRPole as IRPole
from pellicle.dispersion.oscillators import Lorentz as Lorentz
from pellicle.dispersion.oscillators import Oscillators as Oscillators
from pellicle.dispersion.oscillators import TaucLorentz as TaucLorentz
from pellicle.dispersion.oscillators import UVPole as UVPole
from pellicle.dispersion.phonons import Gervais as Gervais
from pellicle.dispersion.psemi import Psemi as Psemi
from pellicle.dispersion.refractiveindex_info import Formula as Formula
from pellicle.dispersion.spline import KramersKronigSpline as KramersKronigSpline
from pellicle.dispersion.spline import Spline as Spline
from pellicle.dispersion.temperature import AtTemperature as AtTemperature
from pellicle.dispersion.temperature import ThermoOptic as ThermoOptic
