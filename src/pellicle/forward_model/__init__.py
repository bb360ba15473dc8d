"""Forward model: a scene and a plan of its effects → the signal."""
