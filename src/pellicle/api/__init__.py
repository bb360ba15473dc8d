"""The public verbs. Each takes a `Scene` (a film) or a `Surface` (a BRDF), and does the same with both."""
