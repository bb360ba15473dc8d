"""Dispersion: complex refractive index n + ik as a function of wavelength."""

from pellicle.dispersion.cody_lorentz import CodyLorentz as CodyLorentz
from pellicle.dispersion.empirical import Cauchy as Cauchy
from pellicle.dispersion.empirical import CauchyUrbach as CauchyUrbach
from pellicle.dispersion.empirical import Constant as Constant
from pellicle.dispersion.empirical import Sellmeier as Sellmeier
from pellicle.dispersion.empirical import Shifted as Shifted
from pellicle.dispersion.empirical import Table as Table
from pellicle.dispersion.empirical import WithExtinction as WithExtinction
from pellicle.dispersion.oscillators import Drude as Drude
from pellicle.dispersion.oscillators import Gaussian as Gaussian
from pellicle.dispersion.oscillators import Lorentz as Lorentz
from pellicle.dispersion.oscillators import Oscillators as Oscillators
from pellicle.dispersion.oscillators import TaucLorentz as TaucLorentz
from pellicle.dispersion.spline import KramersKronigSpline as KramersKronigSpline
from pellicle.dispersion.spline import Spline as Spline
