"""Pellicle looks at a thin layer and says what it is."""

from pellicle.scene import Drift as Drift
from pellicle.scene import Free as Free
from pellicle.scene import Instrument as Instrument
from pellicle.scene import Layer as Layer
from pellicle.scene import Light as Light
from pellicle.scene import Normal as Normal
from pellicle.scene import Scene as Scene
from pellicle.scene import Substrate as Substrate
from pellicle.signals import reflectance as reflectance
from pellicle.signals import transmittance as transmittance
