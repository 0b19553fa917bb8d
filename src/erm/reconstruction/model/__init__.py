"""What walls and their paths are: lines, extents, fits, losses."""
