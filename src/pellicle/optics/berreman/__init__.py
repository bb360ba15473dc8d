"""Layers and substrates of any orientation, in which s and p mix: the 4×4 method of Berreman."""
