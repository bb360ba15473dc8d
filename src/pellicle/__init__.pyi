"""Public names of pellicle, which `__init__.py` imports when they are first used."""

from pellicle import dispersion as dispersion
from pellicle import fitting as fitting
from pellicle.api.fits import compare as compare
from pellicle.api.fits import fit as fit
from pellicle.api.fits import sample as sample
from pellicle.api.identification import identify as identify
from pellicle.api.maps import map as map
from pellicle.api.maps import series as series
from pellicle.api.plans import cost as cost
from pellicle.api.plans import plan as plan
from pellicle.api.plans import plan_measurement as plan_measurement
from pellicle.api.recipe_fits import read_problems as read_problems
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
from pellicle.dispersion import effective_medium, profiles
from pellicle.dispersion.anisotropic import Anisotropic as Anisotropic
from pellicle.fitting.result import Fit as Fit
from pellicle.fitting.result import Status as Status
from pellicle.identification.hypothesis import Identification as Identification
from pellicle.mapping.map_result import Map as Map
from pellicle.mapping.photograph import ThicknessMap as ThicknessMap
from pellicle.mapping.series_result import Series as Series
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
from pellicle.scene.groups import Group as Group
from pellicle.scene.instrument import Instrument as Instrument
from pellicle.scene.layers import Interface as Interface
from pellicle.scene.layers import Layer as Layer
from pellicle.scene.layers import Plate as Plate
from pellicle.scene.layers import Substrate as Substrate
from pellicle.scene.layers import medium as medium
from pellicle.scene.surface import Surface as Surface
from pellicle.scene.surface import SurfaceUncertainty as SurfaceUncertainty
from pellicle.scene.ties import Tied as Tied
from pellicle.scene.uncertainty import Uncertainty as Uncertainty
from pellicle.simulation.brdf import Directions as Directions
from pellicle.simulation.colours import film_colour as film_colour
from pellicle.simulation.depth import absorptance as absorptance
from pellicle.simulation.depth import field as field
from pellicle.simulation.functions import ellipsometry as ellipsometry
from pellicle.simulation.functions import jones as jones
from pellicle.simulation.functions import mueller as mueller
from pellicle.simulation.functions import reflectance as reflectance
from pellicle.simulation.functions import refractive_index as refractive_index
from pellicle.simulation.functions import transmittance as transmittance

mixing = effective_medium
profile = profiles
__version__: str
__all__: list[str]  # pyright: ignore[reportUnsupportedDunderAll]
