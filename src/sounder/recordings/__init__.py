"""Recordings: what they hold, one reader for each format, and the writer of the native format."""
