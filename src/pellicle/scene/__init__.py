"""Scenes of films (layers, substrate, light, instrument) and surfaces with a BRDF, with free parameters."""
