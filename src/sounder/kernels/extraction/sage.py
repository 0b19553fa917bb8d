"""Successive cancellation: find the strongest path, fit it, take it out of every beam, and look again.

A path of amplitude ``a`` from direction ``w`` at delay ``d`` appears in every beam ``b`` as ``a g(w - w_b) p(t - d)``
with a phase of its own, since the phase drifts while the horn turns. Each beam's complex amplitude is therefore
fitted anew, and trusted as long as its magnitude is no more than ``margin`` times what the pattern allows: so a
stronger path's sidelobes, in angle and in delay, go with it, and another path that arrives at the same time stays.
"""

import numpy as np

from sounder.kernels.compiler.compile import jit, part
from sounder.kernels.extraction.columns import (
    AMPLITUDE,
    ANEW,
    AZIMUTH,
    BEAM,
    DELAY,
    ELEVATION,
    OFF_BORESIGHT,
    Beams,
    Real,
    Work,
)
from sounder.kernels.extraction.fit_path import fit
from sounder.kernels.extraction.peak_search import (
    LEVEL,
    OFFSET,
    Integers,
    Limits,
    Search,
    highest,
    mark,
    search_around,
    search_block,
)
from sounder.kernels.extraction.scan_view import REACH, View, aim, pattern

TAKES, TOGETHER, PASSES = range(3)
"""Entries of ``effort``: whether paths are taken out of the beams, how often those that share samples with a new one
are fitted again, and how often all are in the end."""
SHARED = 6
"""Samples between two paths under which a fit of one has samples of the other in it."""


@jit
def cancel(
    beams: Beams, view: View, limits: Limits, effort: Integers, work: Work, search: Search, found: Real, taken: Beams
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
    effort : array (3,)
        What is done about paths that overlap: see `TAKES`.
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
    takes = effort[TAKES] != 0
    n_beams, n_delays = beams.shape
    period = float(n_delays)
    n_blocks = search.peak.shape[1]
    capacity = found.shape[0]
    for b in range(n_beams):
        for block in range(n_blocks):
            search_block(beams, limits, search, b, block)
    reach = 3 * view.limits[REACH]
    count = 0 * capacity  # a literal would have every part that takes it compiled twice
    for _ in range(4 * capacity):  # every round takes at least one peak away
        b, block = highest(search.peak)
        if count == capacity or search.peak[b, block] <= 0.0:
            break
        k = search.where[b, block]
        row = found[count]
        row[BEAM], row[DELAY] = b, k
        row[ANEW] = 1.0
        for each in range(n_beams):
            taken[count, each] = 0
        fit(beams, view, limits.margin, work, row, taken, count, takes)
        mark(view, limits, work, search, row)
        for copy in range(limits.artefact.shape[0]):
            search_around(beams, limits, work, search, row[DELAY] + limits.artefact[copy, OFFSET])
        search.ghost[b, k] = np.inf
        if _within_another(found, count, limits.resolution, period):
            search_around(beams, limits, work, search, row[DELAY])
            continue
        count += 1
        # A path whose pulse holds another's is fitted wrong, and what is left of both looks like more paths: fit such
        # groups again at once, before their remainders are searched.
        for _ in range(effort[TOGETHER]):
            for i in range(count):
                if _share(found[i], row, reach, period):
                    found[i, ANEW] = 0.0
                    fit(beams, view, limits.margin, work, found[i], taken, i, takes)
        for i in range(count):
            if _share(found[i], row, reach, period):
                search_around(beams, limits, work, search, found[i, DELAY])
    b, block = highest(search.peak)
    complete = search.peak[b, block] <= 0.0
    for turn in range(effort[PASSES]):
        for i in range(count):
            found[i, ANEW] = turn == 0
            fit(beams, view, limits.margin, work, found[i], taken, i, takes)
    return _keep(found, taken, count, view, limits, work, period), complete


@part
def _keep(found: Real, taken: Beams, count: int, view: View, limits: Limits, work: Work, period: float) -> int:
    """Move the paths that still exceed the threshold to the front; fitted again, some turn out to be others' parts."""
    kept = 0
    for i in range(count):
        seen = found[i, AMPLITUDE] * found[i, OFF_BORESIGHT]
        above = seen * seen > limits.threshold[int(found[i, BEAM])]
        if above and not _is_copy(found, count, i, view, limits, work, period):
            for column in range(found.shape[1]):
                found[kept, column] = found[i, column]
            for b in range(taken.shape[1]):
                taken[kept, b] = taken[i, b]
            kept += 1
    return kept


@part
def _is_copy(found: Real, count: int, i: int, view: View, limits: Limits, work: Work, period: float) -> bool:
    """Tell whether a path is what the instrument makes of another."""
    b = int(found[i, BEAM])
    seen = found[i, AMPLITUDE] * found[i, OFF_BORESIGHT]
    for copy in range(limits.artefact.shape[0]):
        for j in range(count):
            late = found[j, DELAY] + limits.artefact[copy, OFFSET]
            if _apart(found[i, DELAY], late, period) < limits.resolution[0]:
                aim(found[j, AZIMUTH], found[j, ELEVATION], work.direction)
                g = found[j, AMPLITUDE] * pattern(view, work.direction, b, work.slopes)
                if seen < limits.artefact[copy, LEVEL] * g:
                    return True
    return False


@part
def _share(row: Real, other: Real, azimuth: float, period: float) -> bool:
    """Tell whether two paths are fitted to samples that both are in."""
    return _apart(row[DELAY], other[DELAY], period) < SHARED and _apart(row[AZIMUTH], other[AZIMUTH], 360.0) < azimuth


@part
def _apart(x: float, y: float, period: float) -> float:
    """Distance of two numbers on a circle."""
    late = abs(x - y) % period
    return period - late if 2 * late > period else late


@part
def _within_another(found: Real, count: int, resolution: Real, period: float) -> bool:
    row = found[count]
    for i in range(count):
        if (
            _apart(found[i, DELAY], row[DELAY], period) < resolution[0]
            and _apart(found[i, AZIMUTH], row[AZIMUTH], 360.0) < resolution[1]
            and abs(found[i, ELEVATION] - row[ELEVATION]) < resolution[2]
        ):
            return True
    return False
