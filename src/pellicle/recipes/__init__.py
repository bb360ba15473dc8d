"""Recipes: TOML files and words of the command line to scenes and surfaces."""
