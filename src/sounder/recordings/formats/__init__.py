"""Formats of samples: one file each, which offers ``is_format`` and ``content``."""
