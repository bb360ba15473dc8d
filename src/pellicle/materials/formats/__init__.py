"""Files of optical constants: tables of n, k or of a dielectric function, as instruments write them."""
