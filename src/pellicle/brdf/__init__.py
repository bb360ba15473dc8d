"""BRDF models of surfaces under a thin layer, in 1/sr for R, G and B: directions, lobes and models by name.

Directions are unit vectors away from the surface, in its own frame, whose normal is z. Every model is a
pure function of its parameters and two directions.
"""

from pellicle.brdf.albedo import directional_albedo as directional_albedo
from pellicle.brdf.directions import direction as direction
from pellicle.brdf.models import MODELS as MODELS
from pellicle.brdf.models import PRESETS as PRESETS
from pellicle.brdf.models import Model as Model
from pellicle.brdf.models import model as model
