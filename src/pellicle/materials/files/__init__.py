"""Files of optical constants: tables of n, k or of a dielectric function, as instruments write them."""

from pellicle.materials.files.detect import SUFFIXES as SUFFIXES
from pellicle.materials.files.detect import read_material_file as read_material_file
from pellicle.materials.files.optical_constants import MaterialFile as MaterialFile
