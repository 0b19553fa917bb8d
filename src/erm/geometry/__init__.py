"""Closed forms of single reflections: images, reflection points, faces, and their errors."""
