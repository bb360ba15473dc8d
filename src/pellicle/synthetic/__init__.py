"""Simulated measurements and pictures: spectra, BRDF samples, colours, spheres."""
