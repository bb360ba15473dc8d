"""Files: measured spectra and BRDFs in, results out. Errors are one sentence with the remedy in it."""

from pellicle.io.atomic import new_folder as new_folder
from pellicle.io.atomic import replacing as replacing
from pellicle.io.atomic import write_text as write_text
from pellicle.io.brdf_samples import read_brdf_samples as read_brdf_samples
from pellicle.io.brdf_writers import write_alta as write_alta
from pellicle.io.brdf_writers import write_brdf_samples as write_brdf_samples
from pellicle.io.reference import read_counts as read_counts
from pellicle.io.reference import reflectance_from_counts as reflectance_from_counts
from pellicle.io.samples import BrdfSamples as BrdfSamples
from pellicle.io.spectra import read_spectrum as read_spectrum
from pellicle.io.spectrum import Spectrum as Spectrum
