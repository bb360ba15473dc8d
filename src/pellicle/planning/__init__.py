"""Plans within a tolerance: effects left out, the error made, and the time saved."""
