"""Errors of a survey: of positions, headings, clocks and gains."""
