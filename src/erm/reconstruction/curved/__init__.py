"""Curved faces: paths whose reflection points and normals lie on one vertical cylinder."""
