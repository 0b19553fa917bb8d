"""Names and colours of the methods that the study compares."""

from erm.figures.style import CURVES

PRINTED = "the letter's printed points"
PLANAR = "the letter's planar method"
SINGLE = "ours, single"
MERGED = "ours, merged"
COLOURS = dict(zip((PRINTED, PLANAR, SINGLE, MERGED), CURVES, strict=False))
