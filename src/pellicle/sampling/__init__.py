"""Posterior sampling by an affine-invariant ensemble (emcee)."""
