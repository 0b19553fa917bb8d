"""Maps: environments, materials, outlines and georeferences."""
