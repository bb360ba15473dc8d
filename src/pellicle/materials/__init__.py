"""The catalogue: a name becomes a dispersion with its source, its range and its warnings."""

from pellicle.materials.catalogue import UnknownMaterial as UnknownMaterial
from pellicle.materials.catalogue import lookup as lookup
from pellicle.materials.contents import names as names
from pellicle.materials.contents import pages as pages
from pellicle.materials.material import CLEAR as CLEAR
from pellicle.materials.material import Material as Material
from pellicle.materials.material import materials_in as materials_in
