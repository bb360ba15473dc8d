"""Identification of films: hypotheses about an unknown sample, weighed by their evidence."""
