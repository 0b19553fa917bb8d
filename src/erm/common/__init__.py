"""Errors, files, console output and pages, for all other packages. Nothing here depends on radio."""
