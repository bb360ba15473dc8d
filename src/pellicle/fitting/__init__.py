"""Fits: a scene run backwards."""
