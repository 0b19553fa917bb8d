"""Compiled search and fit of single paths."""
