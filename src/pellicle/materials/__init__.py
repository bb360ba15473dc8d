"""The catalogue: a name becomes a dispersion with its source, its range and its warnings."""

from pellicle.materials.catalogue import UnknownMaterial as UnknownMaterial
from pellicle.materials.catalogue import material as material
from pellicle.materials.contents import names as names
from pellicle.materials.contents import pages as pages
from pellicle.materials.named_dispersion import CLEAR as CLEAR
from pellicle.materials.named_dispersion import Material as Material
from pellicle.materials.named_dispersion import materials_in as materials_in
