"""Fits of layer stacks to reflectance, transmittance and ellipsometry spectra."""
