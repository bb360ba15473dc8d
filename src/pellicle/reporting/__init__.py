"""Reports: text, figures, tables and result folders."""
