"""Levels of evidence: log odds at which a decision is taken."""

TWENTY_TO_ONE = 3.0
"""Log odds of 20 : 1, ``ln 20``, for decisions that an error of one in twenty does not harm."""
THOUSAND_TO_ONE = 6.9
"""Log odds of 1000 : 1, ``ln 1000``, for decisions that must hardly ever be wrong."""
