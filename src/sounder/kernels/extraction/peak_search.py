"""Where the beams hold more than the paths found so far explain.

The search keeps the maximum of each block of delays, so one round costs what one path touches.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.columns import AMPLITUDE, AZIMUTH, DELAY, ELEVATION, Beams, Real, Work
from sounder.kernels.extraction.pulse import nearest, power, sample
from sounder.kernels.extraction.scan_view import OVER, View, aim, pattern

BLOCK = 32
"""Delays in a block of the search."""
OFFSET, LEVEL = range(2)
"""Columns of `Limits.artefact`."""

Level = npt.NDArray[np.float32]
Integers = npt.NDArray[np.int64]


class Limits(NamedTuple):
    """When a peak is a path.

    Attributes
    ----------
    threshold : array (beam,)
        Least power of a path.
    resolution : array (3,)
        Delay [sample], azimuth and elevation [degree] within which two paths are one.
    leftover : array (3,)
        Amplitude under which what remains at a path's delay is its own remainder: relative to the path in that beam;
        and relative to the pattern in a beam's sidelobes, or to the third, the highest sidelobe, in its main lobe.
    artefact : array (artefact, 2)
        Copies that the instrument makes of every path: how much later [sample], and their amplitude at most,
        relative to the path.
    margin : float
        How far the amplitude in a beam may exceed what the pattern predicts and still be that path's.
    """

    threshold: Real
    resolution: Real
    leftover: Real
    artefact: Real
    margin: float


class Search(NamedTuple):
    """State of the search.

    Attributes
    ----------
    ghost : array (beam, delay)
        Power under which a peak is a remainder of paths taken out.
    peak : array (beam, block)
        Highest power over threshold and ghosts, 0 if there is none.
    where : array (beam, block)
        Its delay.
    shape : array (tap,)
        Scratch.
    """

    ghost: Level
    peak: Real
    where: Integers
    shape: Real


def search_of(beams: Beams, work: Work) -> Search:
    """Allocate what a search of these beams needs."""
    blocks = beams.shape[0], -(-beams.shape[1] // BLOCK)
    return Search(
        np.zeros(beams.shape, np.float32), np.zeros(blocks), np.zeros(blocks, np.int64), np.zeros(work.pulse.size)
    )


@part
def highest(peak: Real) -> tuple[int, int]:
    """Beam and block of the highest peak."""
    best, beam, where = -1.0, 0, 0
    for b in range(peak.shape[0]):
        for block in range(peak.shape[1]):
            if peak[b, block] > best:
                best, beam, where = peak[b, block], b, block
    return beam, where


@part
def search_block(beams: Beams, limits: Limits, search: Search, b: int, block: int) -> None:
    """Find the highest peak of a block again."""
    best, where = 0.0, 0
    threshold = limits.threshold[b]
    end = (block + 1) * BLOCK
    if end > beams.shape[1]:
        end = beams.shape[1]
    for k in range(block * BLOCK, end):
        value = beams[b, k]
        power = value.real * value.real + value.imag * value.imag
        if power > threshold and power > search.ghost[b, k] and power > best:
            best, where = power, k
    search.peak[b, block], search.where[b, block] = best, where


@part
def mark(view: View, limits: Limits, work: Work, search: Search, row: Real) -> None:
    """Raise the level under which a peak is a remainder of this path."""
    first = sample(view.pulse, view.grid[OVER], row[DELAY], work.pulse)
    taps = work.pulse.size
    # A remainder is shaped as the pulse or its derivative, so as wide as the pulse and a sample on either side.
    for i in range(taps):
        search.shape[i] = 0.0
        for j in range(i - 1 if i > 0 else 0, i + 2 if i + 2 <= taps else taps):
            high = power(work.pulse[j])
            if high > search.shape[i]:
                search.shape[i] = high
    aim(row[AZIMUTH], row[ELEVATION], work.direction)
    for b in range(search.ghost.shape[0]):
        g = row[AMPLITUDE] * pattern(view, work.direction, b, work.slopes)
        own = limits.leftover[0] * g
        most = limits.leftover[2] * row[AMPLITUDE]
        side = limits.leftover[1] * (g if g < most else most)
        _raise(search, b, first, own if own > side else side)
        for copy in range(limits.artefact.shape[0]):
            late = nearest(limits.artefact[copy, OFFSET])
            _raise(search, b, first + late, limits.artefact[copy, LEVEL] * g)


@part
def _raise(search: Search, b: int, first: int, amplitude: float) -> None:
    """Raise the level in a beam to that of a pulse of an amplitude."""
    period = search.ghost.shape[1]
    level = amplitude * amplitude
    k = first % period
    for i in range(search.shape.size):
        if level * search.shape[i] > search.ghost[b, k]:
            search.ghost[b, k] = level * search.shape[i]
        k += 1
        if k == period:
            k = 0


@part
def search_around(beams: Beams, limits: Limits, work: Work, search: Search, delay: float) -> None:
    """Search again the blocks that a path reached."""
    n_beams, period = beams.shape
    n_blocks = search.peak.shape[1]
    first = nearest(delay) - work.pulse.size // 2
    last = first + work.pulse.size - 1
    for block in range(n_blocks):
        begin = block * BLOCK
        end = begin + BLOCK
        for turn in range(-1, 2):
            if begin + turn * period <= last and end + turn * period > first:
                for b in range(n_beams):
                    search_block(beams, limits, search, b, block)
                break
