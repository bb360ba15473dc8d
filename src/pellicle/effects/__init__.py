"""Plans: the effects of a scene or a surface, which of them may be left out within a tolerance, and why."""
