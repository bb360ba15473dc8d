"""Effects: which of them a scene or a surface has, and why the others are left out."""
