"""Formats of cubes: xarray, zarr, NetCDF, ENVI, TIFF stacks, NumPy files and folders of spectra."""
