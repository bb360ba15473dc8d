"""Pellicle looks at a thin layer and says what it is.

Names are loaded when first used, so that the command line answers before JAX is imported.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.brdf_fitting.fit import fit_brdf as fit_brdf
    from pellicle.brdf_fitting.result import BrdfFit as BrdfFit
    from pellicle.brdf_fitting.sample import sample_brdf as sample_brdf
    from pellicle.fitting.compare import compare as compare
    from pellicle.fitting.fit import fit as fit
    from pellicle.fitting.result import Fit as Fit
    from pellicle.fitting.result import Status as Status
    from pellicle.free import Free as Free
    from pellicle.free import HalfNormal as HalfNormal
    from pellicle.free import LogUniform as LogUniform
    from pellicle.free import Normal as Normal
    from pellicle.instrument import Instrument as Instrument
    from pellicle.io.brdf_samples import read_brdf_samples as read_brdf_samples
    from pellicle.io.recipe import read_recipe as read_recipe
    from pellicle.io.samples import BrdfSamples as BrdfSamples
    from pellicle.io.spectra import read_spectrum as read_spectrum
    from pellicle.io.spectrum import Spectrum as Spectrum
    from pellicle.io.words import medium as medium
    from pellicle.ladder.cost import cost as cost
    from pellicle.layers import Interface as Interface
    from pellicle.layers import Layer as Layer
    from pellicle.layers import Plate as Plate
    from pellicle.layers import Substrate as Substrate
    from pellicle.materials import lookup as material  # noqa: F401
    from pellicle.optics.cody_lorentz import CodyLorentz as CodyLorentz
    from pellicle.optics.dispersion import Cauchy as Cauchy
    from pellicle.optics.dispersion import CauchyUrbach as CauchyUrbach
    from pellicle.optics.dispersion import Constant as Constant
    from pellicle.optics.dispersion import Sellmeier as Sellmeier
    from pellicle.optics.dispersion import Shifted as Shifted
    from pellicle.optics.dispersion import Table as Table
    from pellicle.optics.dispersion import WithExtinction as WithExtinction
    from pellicle.optics.mixtures import Bruggeman as Bruggeman
    from pellicle.optics.mixtures import Linear as Linear
    from pellicle.optics.mixtures import Looyenga as Looyenga
    from pellicle.optics.mixtures import MaxwellGarnett as MaxwellGarnett
    from pellicle.optics.oscillators import Drude as Drude
    from pellicle.optics.oscillators import Gaussian as Gaussian
    from pellicle.optics.oscillators import Lorentz as Lorentz
    from pellicle.optics.oscillators import Oscillators as Oscillators
    from pellicle.optics.oscillators import TaucLorentz as TaucLorentz
    from pellicle.optics.spline import KramersKronigSpline as KramersKronigSpline
    from pellicle.optics.spline import Spline as Spline
    from pellicle.sampling.result import Posterior as Posterior
    from pellicle.sampling.sample import sample as sample
    from pellicle.scene import Light as Light
    from pellicle.scene import Scene as Scene
    from pellicle.signals import ellipsometry as ellipsometry
    from pellicle.signals import reflectance as reflectance
    from pellicle.signals import refractive_index as refractive_index
    from pellicle.signals import transmittance as transmittance
    from pellicle.surfaces.sampling import Directions as Directions
    from pellicle.surfaces.sampling import simulate_brdf as simulate_brdf
    from pellicle.surfaces.surface import Surface as Surface
    from pellicle.synthetic import simulate as simulate
    from pellicle.thrift import plan as plan

_HOME = {
    "pellicle.brdf_fitting.fit": ("fit_brdf",),
    "pellicle.brdf_fitting.result": ("BrdfFit",),
    "pellicle.brdf_fitting.sample": ("sample_brdf",),
    "pellicle.surfaces.sampling": ("Directions", "simulate_brdf"),
    "pellicle.surfaces.surface": ("Surface",),
    "pellicle.synthetic": ("simulate",),
    "pellicle.fitting.compare": ("compare",),
    "pellicle.fitting.fit": ("fit",),
    "pellicle.fitting.result": ("Fit", "Status"),
    "pellicle.io.brdf_samples": ("read_brdf_samples",),
    "pellicle.io.recipe": ("read_recipe",),
    "pellicle.io.samples": ("BrdfSamples",),
    "pellicle.io.spectra": ("read_spectrum",),
    "pellicle.io.spectrum": ("Spectrum",),
    "pellicle.io.words": ("medium",),
    "pellicle.materials": ("material",),
    "pellicle.optics.cody_lorentz": ("CodyLorentz",),
    "pellicle.optics.dispersion": (
        "Cauchy",
        "CauchyUrbach",
        "Constant",
        "Sellmeier",
        "Shifted",
        "Table",
        "WithExtinction",
    ),
    "pellicle.optics.mixtures": ("Bruggeman", "Linear", "Looyenga", "MaxwellGarnett"),
    "pellicle.optics.oscillators": ("Drude", "Gaussian", "Lorentz", "Oscillators", "TaucLorentz"),
    "pellicle.optics.spline": ("KramersKronigSpline", "Spline"),
    "pellicle.thrift": ("plan",),
    "pellicle.instrument": ("Instrument",),
    "pellicle.ladder.cost": ("cost",),
    "pellicle.layers": ("Interface", "Layer", "Plate", "Substrate"),
    "pellicle.free": ("Free", "HalfNormal", "LogUniform", "Normal"),
    "pellicle.sampling.result": ("Posterior",),
    "pellicle.sampling.sample": ("sample",),
    "pellicle.scene": ("Light", "Scene"),
    "pellicle.signals": ("ellipsometry", "reflectance", "refractive_index", "transmittance"),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}
_RENAMED = {"material": "lookup"}

__all__ = sorted(_MODULE)  # pyright: ignore[reportUnsupportedDunderAll]
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module 'pellicle' has no attribute {name!r}")
    return getattr(import_module(_MODULE[name]), _RENAMED.get(name, name))


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
