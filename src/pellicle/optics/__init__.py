"""Light in thin layers: interfaces, films, stacks and plates."""
