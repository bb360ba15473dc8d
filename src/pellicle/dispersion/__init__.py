"""Dispersion: complex refractive index n + ik as a function of wavelength."""
