"""Plans within a tolerance, and what leaving out each effect saves."""
