"""The three ways by which the study reads a component, in one name and colour each."""

from erm.figures.style import CURVES

PRINTED = "the letter's printed points"
PLANAR = "the letter's planar method"
SINGLE = "ours, each MPC by itself"
MERGED = "ours, merged"
COLOURS = dict(zip((PRINTED, PLANAR, SINGLE, MERGED), CURVES, strict=False))
