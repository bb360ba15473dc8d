"""Results as pages for a browser: each one self-contained file that opens from disk and loads nothing."""
