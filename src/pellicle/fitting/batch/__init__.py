"""Fits of many spectra of one scene and grid: search, errors and status, vectorised over the spectra."""
