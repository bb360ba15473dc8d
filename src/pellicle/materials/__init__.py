"""The catalogue: a name becomes a dispersion with its source, its range and its warnings."""

from pellicle.materials.catalogue import CLEAR as CLEAR
from pellicle.materials.catalogue import ROUNDING as ROUNDING
from pellicle.materials.catalogue import Material as Material
from pellicle.materials.catalogue import UnknownMaterial as UnknownMaterial
from pellicle.materials.catalogue import check_common_range as check_common_range
from pellicle.materials.catalogue import common_range as common_range
from pellicle.materials.catalogue import limits as limits
from pellicle.materials.catalogue import material as material
from pellicle.materials.catalogue import materials_in as materials_in
from pellicle.materials.contents import names as names
from pellicle.materials.contents import pages as pages
