"""The search for mirror images that many paths share."""
