"""Tables in text files: decoding, layout, and named columns with units."""
