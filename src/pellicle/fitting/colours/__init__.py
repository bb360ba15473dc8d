"""Fits of a film's colours: the spectrum integrated by an observer or a camera."""
