"""Measured data: spectra, BRDF samples, and readers of their files."""
