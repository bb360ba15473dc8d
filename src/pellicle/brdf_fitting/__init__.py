"""Fits of layered surfaces to samples of a BRDF: `fit` leads, and doubts before it believes."""
