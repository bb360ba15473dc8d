"""Posteriors: what the data leave of each parameter, by ensemble sampling over every minimum that matters."""
