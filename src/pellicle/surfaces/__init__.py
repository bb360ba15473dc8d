"""Layered surfaces, RGB: what a recipe says of one, and its samples."""
