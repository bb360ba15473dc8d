"""One layer and its light: pure functions of arrays, no files and no options."""
