"""Closed forms of single bounces on vertical and on sloped faces."""
