"""Directions that are shifted against others, from delays of paths in overlapping beams."""

import numpy as np
from numpy.typing import NDArray

from sounder.quality.beams import MIN_BEAMS
from sounder.quality.delays import Delays
from sounder.quality.shapes import Shapes

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST = 0.75
"""Share of the other beams that see a path, or of what a beam sees, that must agree."""
HALF = 0.5
"""Difference from which a delay is nearer to another sample [sample]."""


def slips(delays: Delays, shapes: Shapes, elevations: int) -> Integers:
    """Delay (beam,) of each beam against the others [sample]; 0 unless it has slipped by a whole number of samples.

    A path counts for a beam if most other beams that see it agree; of these paths the one about which most agree tells
    the delay of the beam. The shift must explain what the beam sees of this path, and most others, weighted by how many
    agree about them, must not contradict it. A slip by more than a sample must show in as many paths.
    """
    off, agree, settled = _against_others(delays, elevations)
    sure = settled & (delays.tolerance < HALF)
    shifts = np.zeros(len(shapes.responses), np.int64)
    for beam in np.unique(delays.beam[sure]):
        own = np.flatnonzero(sure & (delays.beam == beam))
        best = own[np.argmax(agree[own])]
        if np.abs(off[best]) <= HALF:
            continue
        shift = int(np.rint(off[best]))
        fits = np.abs(off[own] - shift) < delays.tolerance[own]
        if fits.sum() < np.abs(shift) or agree[own][fits].sum() < MOST * agree[own].sum():
            continue
        others = (delays.path == delays.path[best]) & (np.abs(off) < delays.tolerance) & (delays.beam != beam)
        if shapes.explains(delays, others, int(best), shift):
            shifts[beam] = shift
    return shifts


def unsettled(delays: Delays, beams: int, elevations: int) -> Real:
    """How far beams (beam,) are off the path about which most others agree, if they agree about none [sample]."""
    off, agree, settled = _against_others(delays, elevations)
    sure = settled & (delays.tolerance < HALF)
    figure = np.zeros(beams)
    for beam in np.unique(delays.beam[sure]):
        own = np.flatnonzero(sure & (delays.beam == beam))
        if (np.abs(off[own]) > HALF).all():
            figure[beam] = off[own[np.argmax(agree[own])]]
    return figure


def _against_others(delays: Delays, elevations: int) -> tuple[Real, Integers, NDArray[np.bool_]]:
    """Delays against the median of their paths, how many other beams agree, and whether these settle it.

    They do if most agree, or if most of those that see it through their sidelobes agree and most others are off by
    whole samples.

    Beams with a path in their main lobe see others beside it that are not resolved, and are off by the same: the median
    of what they are off whole samples. The lowest of them see its reflection off the ground, the highest one off a
    ceiling, which has its azimuth and is later: they are compared with each other if all but one are later by the same.
    """
    off, group = delays.off, delays.path.copy()
    for path in np.unique(delays.path):
        lobe = (delays.path == path) & ~delays.far
        for edge in (0, elevations - 1):
            row = lobe & (delays.beam % elevations == edge)
            known = np.flatnonzero(row & (delays.tolerance < HALF))
            late = float(np.median(off[known])) if known.size else 0.0
            alike = np.count_nonzero(np.abs(off[known] - late) < delays.tolerance[known])
            if late > HALF and alike >= max(MIN_BEAMS, known.size - 1):
                off[row] -= late
                group[row] = group.max() + 1
        if lobe.any():
            off[lobe] -= np.median(off[lobe] - np.rint(off[lobe]))
    fits = np.abs(off) < delays.tolerance
    whole = np.abs(off - np.rint(off)) < delays.tolerance
    seen, agree, seen_far, agree_far, agree_whole = (
        np.bincount(group, one)[group] for one in (fits | True, fits, delays.far, fits & delays.far, whole)
    )
    most = agree - fits >= MOST * (seen - 1)
    most |= (agree_far >= np.maximum(MIN_BEAMS, MOST * seen_far)) & (agree_whole >= MOST * seen)
    agree = agree.astype(np.int64) - fits
    return off, agree, most & (agree >= MIN_BEAMS)
