"""A ladder of ways to one answer: what each leaves out, how far off it is, and what it costs."""
