"""Page of the explorer: template, style and script, which a notebook shows as a widget."""
