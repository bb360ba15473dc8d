"""Maps: cubes of spectra and photographs to the thickness at every pixel, with a status for each."""
