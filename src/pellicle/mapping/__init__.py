"""Maps: cubes of spectra and pictures to the thickness at every pixel, with a status for each."""
