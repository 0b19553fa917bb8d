"""Paths, lines and walls in arrays, and how they are fitted to each other."""
