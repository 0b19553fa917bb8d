"""Evaluation of maps: against a known outline, and against measurements."""
