"""Tables in text files: from characters to named columns with units."""
