"""Pellicle: thickness and refractive index of thin layers from measured spectra and BRDF samples.

Names are imported when first used, so that the command line answers before JAX is imported.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle import dispersion as dispersion
    from pellicle import fitting as fitting
    from pellicle.api.fits import compare as compare
    from pellicle.api.fits import fit as fit
    from pellicle.api.fits import sample as sample
    from pellicle.api.maps import map as map
    from pellicle.api.plans import cost as cost
    from pellicle.api.plans import plan as plan
    from pellicle.api.simulations import depth_profile as depth_profile
    from pellicle.api.simulations import explore as explore
    from pellicle.api.simulations import export as export
    from pellicle.api.simulations import simulate as simulate
    from pellicle.data.brdf_samples import BrdfSamples as BrdfSamples
    from pellicle.data.colours import CameraMatrix as CameraMatrix
    from pellicle.data.colours import Colours as Colours
    from pellicle.data.cube import Cube as Cube
    from pellicle.data.read_brdf import read_brdf_samples as read_brdf_samples
    from pellicle.data.read_colours import read_colours as read_colours
    from pellicle.data.read_colours import read_colours_by_film as read_colours_by_film
    from pellicle.data.read_cube import read_cube as read_cube
    from pellicle.data.read_spectrum import read_spectra as read_spectra
    from pellicle.data.read_spectrum import read_spectrum as read_spectrum
    from pellicle.data.spectrum import Spectrum as Spectrum
    from pellicle.data.write_spectrum import write_spectrum as write_spectrum
    from pellicle.dispersion import effective_medium as mixing  # noqa: F401
    from pellicle.dispersion import profiles as profile  # noqa: F401
    from pellicle.dispersion.anisotropic import Anisotropic as Anisotropic
    from pellicle.fitting.result import Fit as Fit
    from pellicle.fitting.result import Status as Status
    from pellicle.mapping.map_result import Map as Map
    from pellicle.mapping.photograph import ThicknessMap as ThicknessMap
    from pellicle.materials import material as material
    from pellicle.recipes.read import read_recipe as read_recipe
    from pellicle.recipes.write import write_recipe as write_recipe
    from pellicle.reporting.present import report as report
    from pellicle.sampling.result import Posterior as Posterior
    from pellicle.scene import priors as priors
    from pellicle.scene.film import Light as Light
    from pellicle.scene.film import Reference as Reference
    from pellicle.scene.film import Scene as Scene
    from pellicle.scene.free import Free as Free
    from pellicle.scene.graded import Graded as Graded
    from pellicle.scene.instrument import Instrument as Instrument
    from pellicle.scene.layers import Interface as Interface
    from pellicle.scene.layers import Layer as Layer
    from pellicle.scene.layers import Plate as Plate
    from pellicle.scene.layers import Substrate as Substrate
    from pellicle.scene.layers import Uncertainty as Uncertainty
    from pellicle.scene.layers import medium as medium
    from pellicle.scene.surface import Surface as Surface
    from pellicle.simulation.brdf import Directions as Directions
    from pellicle.simulation.depth import absorptance as absorptance
    from pellicle.simulation.depth import field as field
    from pellicle.simulation.functions import ellipsometry as ellipsometry
    from pellicle.simulation.functions import jones as jones
    from pellicle.simulation.functions import mueller as mueller
    from pellicle.simulation.functions import reflectance as reflectance
    from pellicle.simulation.functions import refractive_index as refractive_index
    from pellicle.simulation.functions import transmittance as transmittance

_NAMES = {
    "pellicle.api.simulations": ("simulate", "depth_profile", "explore", "export"),
    "pellicle.api.plans": ("plan", "cost"),
    "pellicle.api.fits": ("fit", "sample", "compare"),
    "pellicle.api.maps": ("map",),
    "pellicle.data.brdf_samples": ("BrdfSamples",),
    "pellicle.data.colours": ("CameraMatrix", "Colours"),
    "pellicle.data.cube": ("Cube",),
    "pellicle.data.read_brdf": ("read_brdf_samples",),
    "pellicle.data.read_cube": ("read_cube",),
    "pellicle.data.read_spectrum": ("read_spectra", "read_spectrum"),
    "pellicle.data.spectrum": ("Spectrum",),
    "pellicle.data.write_spectrum": ("write_spectrum",),
    "pellicle.mapping.map_result": ("Map",),
    "pellicle.mapping.photograph": ("ThicknessMap",),
    "pellicle.dispersion.anisotropic": ("Anisotropic",),
    "pellicle.fitting.result": ("Fit", "Status"),
    "pellicle.materials": ("material",),
    "pellicle.data.read_colours": ("read_colours", "read_colours_by_film"),
    "pellicle.recipes.read": ("read_recipe",),
    "pellicle.recipes.write": ("write_recipe",),
    "pellicle.reporting.present": ("report",),
    "pellicle.sampling.result": ("Posterior",),
    "pellicle.scene.film": ("Light", "Reference", "Scene"),
    "pellicle.scene.free": ("Free",),
    "pellicle.scene.graded": ("Graded",),
    "pellicle.scene.instrument": ("Instrument",),
    "pellicle.scene.layers": ("Interface", "Layer", "Plate", "Substrate", "Uncertainty", "medium"),
    "pellicle.scene.surface": ("Surface",),
    "pellicle.simulation.depth": ("absorptance", "field"),
    "pellicle.simulation.functions": (
        *("ellipsometry", "jones", "mueller", "reflectance", "refractive_index", "transmittance"),
    ),
    "pellicle.simulation.brdf": ("Directions",),
}
_MODULE = {name: module for module, names in _NAMES.items() for name in names}
_NAMESPACES = {
    "dispersion": "pellicle.dispersion",
    "fitting": "pellicle.fitting",
    "mixing": "pellicle.dispersion.effective_medium",
    "priors": "pellicle.scene.priors",
    "profile": "pellicle.dispersion.profiles",
}

__all__ = sorted([*_MODULE, *_NAMESPACES])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("pellicle")
    if name in _NAMESPACES:
        return import_module(_NAMESPACES[name])
    if name not in _MODULE:
        raise AttributeError(f"module 'pellicle' has no attribute {name!r}")
    return getattr(import_module(_MODULE[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
