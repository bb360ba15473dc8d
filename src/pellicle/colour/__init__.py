"""Colour of a film in XYZ, sRGB and Lab, by sampling the spectrum or by Fourier orders.

`observers` has observers, cameras and illuminants, `bands` the methods of integration, `film` the colour of
a film, `table` a table of them, `inverse` the thicknesses of a colour, `spaces` the conversions between
colour spaces and colour differences.
"""

from pellicle.colour.bands import Bands as Bands
from pellicle.colour.bands import integration_bands as integration_bands
from pellicle.colour.film import film_colour as film_colour
from pellicle.colour.inverse import ColourInverse as ColourInverse
from pellicle.colour.inverse import invert as invert
from pellicle.colour.observers import sensor as sensor
from pellicle.colour.spaces import delta_e76 as delta_e76
from pellicle.colour.spaces import delta_e2000 as delta_e2000
from pellicle.colour.spaces import lab as lab
from pellicle.colour.spaces import linear_srgb as linear_srgb
from pellicle.colour.spaces import srgb as srgb
from pellicle.colour.table import FilmColourTable as FilmColourTable
