"""Fits of layer stacks to spectra, ellipsometry and colours."""
