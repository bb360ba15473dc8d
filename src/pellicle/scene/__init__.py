"""Scenes: layers on a substrate, the light and the instrument; and surfaces with a layered BRDF."""
