"""Times of whole fits: pellicle, SciPy and lmfit on the same simulated data."""
