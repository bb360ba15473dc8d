"""Least-squares fits: minima, uncertainties, identifiability and status."""
