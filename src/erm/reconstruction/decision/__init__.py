"""The decision which common images are walls, and where these stand."""
