"""Simulated cubes of films, and other programs that fit their pixels."""
