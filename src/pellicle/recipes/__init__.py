"""Recipes: TOML files and command-line words to scenes and surfaces."""
