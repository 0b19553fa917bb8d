"""Successive cancellation: find the strongest path, fit it, take it out of every beam, and look again.

A path of amplitude ``a`` from direction ``w`` at delay ``d`` appears in every beam ``b`` as ``a g(w - w_b) p(t - d)``
with a phase of its own, since the phase drifts while the horn turns. Each beam's complex amplitude is therefore
fitted anew, and trusted as long as its magnitude is no more than ``margin`` times what the pattern allows: so a
stronger path's sidelobes, in angle and in delay, go with it, and another path that arrives at the same time stays.

The search keeps the maximum of each block of delays, so one round costs what one path touches.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compile import jit, part
from sounder.kernels.component import (
    AMPLITUDE,
    AZIMUTH,
    BEAM,
    DELAY,
    ELEVATION,
    LEFT_OVER,
    OFF_BORESIGHT,
    Beams,
    Real,
    Work,
)
from sounder.kernels.path import fit, fit_again, take
from sounder.kernels.pulse import nearest, power_around, sample
from sounder.kernels.view import OVER, REACH, View, aim, pattern

BLOCK = 32
"""Delays in a block of the search."""
TOGETHER = 3
"""Rounds of fitting paths again that share samples with a new one."""
SHARED = 6
"""Samples between two paths under which a fit of one has samples of the other in it."""

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
    margin : float
        How far the amplitude in a beam may exceed what the pattern predicts and still be that path's.
    """

    threshold: Real
    resolution: Real
    leftover: Real
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


@jit
def cancel(
    beams: Beams, view: View, limits: Limits, passes: int, work: Work, search: Search, found: Real, taken: Beams
) -> tuple[int, bool]:
    """Extract paths from the CIRs of all beams; ``beams`` holds what is left.

    Parameters
    ----------
    beams : array (beam, delay)
        CIRs, azimuth-major; NaN rows are beams that were not recorded.
    view : View
        What the beams see a path with.
    limits : Limits
        When a peak is a path.
    passes : int
        Rounds of fitting all paths again, each against the others' remainder.
    work, search : Work, Search
        Scratch, from `work_of` and `search_of`.
    found : array (capacity, COLUMNS)
        Filled with the paths.
    taken : array (capacity, beam)
        Filled with the amplitude that was taken out of each beam.

    Returns
    -------
    count : int
        Number of paths.
    complete : bool
        False where peaks were left when ``found`` was full.
    """
    n_beams, n_delays = beams.shape
    n_blocks = search.peak.shape[1]
    capacity = found.shape[0]
    for b in range(n_beams):
        for block in range(n_blocks):
            _search_block(beams, limits, search, b, block)
    count = 0 * capacity  # a literal would have every part that takes it compiled twice
    for _ in range(4 * capacity):  # every round takes at least one peak away
        b, block = _highest(search.peak)
        if count == capacity or search.peak[b, block] <= 0.0:
            break
        k = search.where[b, block]
        row = found[count]
        row[BEAM], row[DELAY] = b, k
        fit(beams, view, work, row, True)
        take(beams, view, limits.margin, work, row, taken, count)
        row[LEFT_OVER] = power_around(beams, b, row[DELAY])
        _mark(view, limits, work, search, row)
        search.ghost[b, k] = np.inf
        if _within_another(found, count, limits.resolution, n_delays):
            _search_around(beams, limits, work, search, row[DELAY])
            continue
        count += 1
        # A path whose pulse holds another's is fitted wrong, and what is left of both looks like more paths: fit such
        # groups again at once, before their remainders are searched.
        reach = 3 * view.limits[REACH]
        for _ in range(TOGETHER):
            for i in range(count):
                if _share(found[i], row, reach, n_delays):
                    fit_again(beams, view, limits.margin, work, found[i], taken, i, False)
        for i in range(count):
            if _share(found[i], row, reach, n_delays):
                _search_around(beams, limits, work, search, found[i, DELAY])
    b, block = _highest(search.peak)
    complete = search.peak[b, block] <= 0.0
    for turn in range(passes):
        for i in range(count):
            fit_again(beams, view, limits.margin, work, found[i], taken, i, turn == 0)
    return _keep(found, count, limits.threshold), complete


@part
def _keep(found: Real, count: int, threshold: Real) -> int:
    """Move the paths that still exceed the threshold to the front; fitted again, some turn out to be others' parts."""
    kept = 0
    for i in range(count):
        power = (found[i, AMPLITUDE] * found[i, OFF_BORESIGHT]) ** 2
        if power > threshold[int(found[i, BEAM])]:
            for column in range(found.shape[1]):
                found[kept, column] = found[i, column]
            kept += 1
    return kept


@part
def _highest(peak: Real) -> tuple[int, int]:
    """Beam and block of the highest peak."""
    best, beam, where = -1.0, 0, 0
    for b in range(peak.shape[0]):
        for block in range(peak.shape[1]):
            if peak[b, block] > best:
                best, beam, where = peak[b, block], b, block
    return beam, where


@part
def _search_block(beams: Beams, limits: Limits, search: Search, b: int, block: int) -> None:
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
def _share(row: Real, other: Real, azimuth: float, period: int) -> bool:
    """Tell whether two paths are fitted to samples that both are in."""
    return _apart(row[DELAY], other[DELAY], period) < SHARED and _apart(row[AZIMUTH], other[AZIMUTH], 360) < azimuth


@part
def _apart(x: float, y: float, period: int) -> float:
    """Distance of two numbers on a circle."""
    late = abs(x - y) % period
    return period - late if 2 * late > period else late


@part
def _mark(view: View, limits: Limits, work: Work, search: Search, row: Real) -> None:
    """Raise the level under which a peak is a remainder of this path."""
    first = sample(view.pulse, view.grid[OVER], row[DELAY], work.pulse)
    taps = work.pulse.size
    # A remainder is shaped as the pulse or its derivative, so as wide as the pulse and a sample on either side.
    for i in range(taps):
        search.shape[i] = 0.0
        for j in range(i - 1 if i > 0 else 0, i + 2 if i + 2 <= taps else taps):
            power = work.pulse[j].real ** 2 + work.pulse[j].imag ** 2
            if power > search.shape[i]:
                search.shape[i] = power
    n_beams, period = search.ghost.shape
    aim(row[AZIMUTH], row[ELEVATION], work.direction)
    for b in range(n_beams):
        g = pattern(view, work.direction, b, work.slopes)
        own = limits.leftover[0] * g
        side = limits.leftover[1] * (g if g < limits.leftover[2] else limits.leftover[2])
        level = (row[AMPLITUDE] * (own if own > side else side)) ** 2
        k = first % period
        for i in range(taps):
            if level * search.shape[i] > search.ghost[b, k]:
                search.ghost[b, k] = level * search.shape[i]
            k += 1
            if k == period:
                k = 0


@part
def _search_around(beams: Beams, limits: Limits, work: Work, search: Search, delay: float) -> None:
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
                    _search_block(beams, limits, search, b, block)
                break


@part
def _within_another(found: Real, count: int, resolution: Real, period: int) -> bool:
    row = found[count]
    for i in range(count):
        if (
            _apart(found[i, DELAY], row[DELAY], period) < resolution[0]
            and _apart(found[i, AZIMUTH], row[AZIMUTH], 360) < resolution[1]
            and abs(found[i, ELEVATION] - row[ELEVATION]) < resolution[2]
        ):
            return True
    return False
