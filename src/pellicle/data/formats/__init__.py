"""File formats of instruments and BRDF databases."""
