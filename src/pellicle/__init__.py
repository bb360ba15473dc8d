"""Pellicle looks at a thin layer and says what it is.

Names are loaded when first used, so that the command line answers before JAX is imported.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.accuracy.cost import cost as cost
    from pellicle.data.brdf_samples import BrdfSamples as BrdfSamples
    from pellicle.data.read_brdf import read_brdf_samples as read_brdf_samples
    from pellicle.data.read_spectrum import read_spectrum as read_spectrum
    from pellicle.data.spectrum import Spectrum as Spectrum
    from pellicle.dispersion.cody_lorentz import CodyLorentz as CodyLorentz
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
    from pellicle.dispersion.oscillators import Drude as Drude
    from pellicle.dispersion.oscillators import Gaussian as Gaussian
    from pellicle.dispersion.oscillators import Lorentz as Lorentz
    from pellicle.dispersion.oscillators import Oscillators as Oscillators
    from pellicle.dispersion.oscillators import TaucLorentz as TaucLorentz
    from pellicle.dispersion.spline import KramersKronigSpline as KramersKronigSpline
    from pellicle.dispersion.spline import Spline as Spline
    from pellicle.fitting.brdf.fit import fit_brdf as fit_brdf
    from pellicle.fitting.brdf.result import BrdfFit as BrdfFit
    from pellicle.fitting.result import Fit as Fit
    from pellicle.fitting.result import Status as Status
    from pellicle.fitting.spectra.compare import compare as compare
    from pellicle.fitting.spectra.fit import fit as fit
    from pellicle.materials import lookup as material  # noqa: F401
    from pellicle.planning.film import plan as plan
    from pellicle.recipes.media_words import medium as medium
    from pellicle.recipes.read import read_recipe as read_recipe
    from pellicle.sampling.brdf import sample_brdf as sample_brdf
    from pellicle.sampling.result import Posterior as Posterior
    from pellicle.sampling.spectra import sample as sample
    from pellicle.scene.film import Light as Light
    from pellicle.scene.film import Scene as Scene
    from pellicle.scene.free import Free as Free
    from pellicle.scene.free import HalfNormal as HalfNormal
    from pellicle.scene.free import LogUniform as LogUniform
    from pellicle.scene.free import Normal as Normal
    from pellicle.scene.instrument import Instrument as Instrument
    from pellicle.scene.layers import Interface as Interface
    from pellicle.scene.layers import Layer as Layer
    from pellicle.scene.layers import Plate as Plate
    from pellicle.scene.layers import Substrate as Substrate
    from pellicle.scene.surface import Surface as Surface
    from pellicle.simulation.functions import ellipsometry as ellipsometry
    from pellicle.simulation.functions import reflectance as reflectance
    from pellicle.simulation.functions import refractive_index as refractive_index
    from pellicle.simulation.functions import transmittance as transmittance
    from pellicle.synthetic.brdf import Directions as Directions
    from pellicle.synthetic.brdf import simulate_brdf as simulate_brdf
    from pellicle.synthetic.spectra import simulate as simulate

_HOME = {
    "pellicle.fitting.brdf.fit": ("fit_brdf",),
    "pellicle.fitting.brdf.result": ("BrdfFit",),
    "pellicle.sampling.brdf": ("sample_brdf",),
    "pellicle.synthetic.brdf": ("Directions", "simulate_brdf"),
    "pellicle.scene.surface": ("Surface",),
    "pellicle.synthetic.spectra": ("simulate",),
    "pellicle.fitting.spectra.compare": ("compare",),
    "pellicle.fitting.spectra.fit": ("fit",),
    "pellicle.fitting.result": ("Fit", "Status"),
    "pellicle.data.read_brdf": ("read_brdf_samples",),
    "pellicle.recipes.read": ("read_recipe",),
    "pellicle.data.brdf_samples": ("BrdfSamples",),
    "pellicle.data.read_spectrum": ("read_spectrum",),
    "pellicle.data.spectrum": ("Spectrum",),
    "pellicle.recipes.media_words": ("medium",),
    "pellicle.materials": ("material",),
    "pellicle.dispersion.cody_lorentz": ("CodyLorentz",),
    "pellicle.dispersion.empirical": (
        "Cauchy",
        "CauchyUrbach",
        "Constant",
        "Sellmeier",
        "Shifted",
        "Table",
        "WithExtinction",
    ),
    "pellicle.dispersion.effective_medium": ("Bruggeman", "Linear", "Looyenga", "MaxwellGarnett"),
    "pellicle.dispersion.oscillators": ("Drude", "Gaussian", "Lorentz", "Oscillators", "TaucLorentz"),
    "pellicle.dispersion.spline": ("KramersKronigSpline", "Spline"),
    "pellicle.planning.film": ("plan",),
    "pellicle.scene.instrument": ("Instrument",),
    "pellicle.accuracy.cost": ("cost",),
    "pellicle.scene.layers": ("Interface", "Layer", "Plate", "Substrate"),
    "pellicle.scene.free": ("Free", "HalfNormal", "LogUniform", "Normal"),
    "pellicle.sampling.result": ("Posterior",),
    "pellicle.sampling.spectra": ("sample",),
    "pellicle.scene.film": ("Light", "Scene"),
    "pellicle.simulation.functions": ("ellipsometry", "reflectance", "refractive_index", "transmittance"),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}
_RENAMED = {"material": "lookup"}

__all__ = sorted(_MODULE)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("pellicle")
    if name not in _MODULE:
        raise AttributeError(f"module 'pellicle' has no attribute {name!r}")
    return getattr(import_module(_MODULE[name]), _RENAMED.get(name, name))


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
