"""The twin of the instrument: from a scene to raw captures."""
