"""How surfaces under a thin layer reflect light, RGB, in 1/sr: directions, lobes, and models by name.

Directions are unit vectors away from the surface in its own frame, whose normal is z. Every model is
a pure function of its parameters and two directions (`models.MODELS`).
"""
