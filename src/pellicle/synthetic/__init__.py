"""Simulated measurements and renderings: spectra, BRDF samples, colours, spheres."""
