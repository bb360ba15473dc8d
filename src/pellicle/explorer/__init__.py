"""Explorer: a scene whose numbers are moved by sliders, as a local page or a widget of a notebook."""
