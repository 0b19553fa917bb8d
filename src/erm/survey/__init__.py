"""Errors of a survey: heading, clock and gain that all measurements share."""
