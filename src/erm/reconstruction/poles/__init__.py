"""Poles: paths that share a reflection point."""
