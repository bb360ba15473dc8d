"""Kinds of signals: what the numbers of a spectrum are, and how a fit compares them with a simulation."""
