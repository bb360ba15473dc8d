"""Forward models: signals of scenes and surfaces, with the effects of their plan."""
