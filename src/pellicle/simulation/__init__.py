"""Simulation: functions of numbers, simulated measurements of scenes and surfaces, renderings of spheres."""
