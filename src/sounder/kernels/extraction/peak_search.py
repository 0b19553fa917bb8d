"""Peaks: where the links hold more than the paths found so far explain.

The search keeps the maximum of each block of delays, so one round costs what one path touches.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.pulse import Cir, nearest, power, sample
from sounder.kernels.extraction.records import ARRIVAL, Paths
from sounder.kernels.extraction.scan_view import ScanView, link_gain, toward_path
from sounder.kernels.extraction.workspace import Workspace

BLOCK = 32
"""Delays in a block of the search."""

Real = npt.NDArray[np.float64]


class Search(NamedTuple):
    """State of the search.

    Attributes
    ----------
    remainder : array (link, delay)
        Power under which a peak is a remainder of subtracted paths.
    peak : array (link, block)
        Highest power over threshold and remainders, 0 if there is none.
    delay : array (link, block)
        Its delay.
    envelope : array (tap,)
        Power of a remainder around a path's delay, over that at the delay.
    """

    remainder: npt.NDArray[np.float32]
    peak: Real
    delay: npt.NDArray[np.int64]
    envelope: Real


def new_search(cir: Cir, work: Workspace) -> Search:
    """Allocate what a search of these beams needs."""
    blocks = cir.shape[0], -(-cir.shape[1] // BLOCK)
    return Search(
        np.zeros(cir.shape, np.float32), np.zeros(blocks), np.zeros(blocks, np.int64), np.zeros(work.pulse.size)
    )


@part
def highest_peak(peak: Real) -> tuple[int, int]:
    """Link and block of the highest peak."""
    best, beam, where = -1.0, 0, 0
    for b in range(peak.shape[0]):
        for block in range(peak.shape[1]):
            if peak[b, block] > best:
                best, beam, where = peak[b, block], b, block
    return beam, where


@part
def search_block(cir: Cir, view: ScanView, search: Search, b: int, block: int) -> None:
    """Find the highest peak of a block again."""
    best, where = 0.0, 0
    threshold = view.links[b].threshold
    end = (block + 1) * BLOCK
    if end > cir.shape[1]:
        end = cir.shape[1]
    for k in range(block * BLOCK, end):
        value = cir[b, k]
        height = value.real * value.real + value.imag * value.imag
        if height > threshold and height > search.remainder[b, k] and height > best:
            best, where = height, k
    search.peak[b, block], search.delay[b, block] = best, where


@part
def expect_remainder(view: ScanView, work: Workspace, search: Search, path: Paths) -> None:
    """Raise the power under which a peak is a remainder of this path, or a copy that the instrument makes of it."""
    amplitude = path[ARRIVAL].amplitude
    first = sample(view.pulse, view.oversampling, path[ARRIVAL].delay, work.pulse)
    taps = work.pulse.size
    # A remainder is shaped as the pulse or its derivative, so as wide as the pulse and a sample on either side.
    for i in range(taps):
        search.envelope[i] = 0.0
        for j in range(i - 1 if i > 0 else 0, i + 2 if i + 2 <= taps else taps):
            height = power(work.pulse[j])
            if height > search.envelope[i]:
                search.envelope[i] = height
    directions = toward_path(path)
    for b in range(search.remainder.shape[0]):
        g = amplitude * link_gain(view, b, directions)
        own = view.remainder * g
        most = view.sidelobe_level * amplitude
        side = view.sidelobe_remainder * (g if g < most else most)
        _raise(search, b, first, own if own > side else side)
        for copy in range(view.artefacts.size):
            late = nearest(view.artefacts[copy].delay)
            _raise(search, b, first + late, view.artefacts[copy].amplitude * g)


@part
def _raise(search: Search, b: int, first: int, amplitude: float) -> None:
    """Raise the level in a beam to that of a pulse of an amplitude."""
    period = search.remainder.shape[1]
    level = amplitude * amplitude
    k = first % period
    for i in range(search.envelope.size):
        if level * search.envelope[i] > search.remainder[b, k]:
            search.remainder[b, k] = level * search.envelope[i]
        k += 1
        if k == period:
            k = 0


@part
def search_around(cir: Cir, view: ScanView, work: Workspace, search: Search, delay: float) -> None:
    """Search again the blocks that a path reached."""
    n_beams, period = cir.shape
    n_blocks = search.peak.shape[1]
    first = nearest(delay) - work.pulse.size // 2
    last = first + work.pulse.size - 1
    for block in range(n_blocks):
        begin = block * BLOCK
        end = begin + BLOCK
        for turn in range(-1, 2):
            if begin + turn * period <= last and end + turn * period > first:
                for b in range(n_beams):
                    search_block(cir, view, search, b, block)
                break
