"""Compiled correlation with periodic sequences."""
