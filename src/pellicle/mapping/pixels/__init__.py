"""Fits of the spectra of many pixels by one scene: search, errors and status, vectorised over the pixels."""
