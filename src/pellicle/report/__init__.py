"""What is told of a result: text, figures, tables of materials."""
