"""The twin of the instrument: from a scene to the raw captures that the instrument would record."""
