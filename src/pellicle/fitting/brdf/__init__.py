"""Fits of layered surfaces to BRDF samples."""
