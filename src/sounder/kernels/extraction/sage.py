"""Successive cancellation: find the strongest path, fit it, subtract it from every link, and repeat.

A link is a beam at departure and one at arrival. A path of amplitude ``a`` at delay ``d`` appears in every link with
the product of the patterns of its beams toward the path, ``a g_t g_b p(t - d)``, and a phase of its own, since the
phase drifts while the horn turns. The complex amplitude is therefore fitted in each link, and used if its magnitude is
no more than a margin times what the pattern allows. So the sidelobes of a path, in angle and in delay, are subtracted
with it, and another path that arrives at the same time stays.
"""

from typing import NamedTuple

import numpy as np

from sounder.kernels.compiler.compile import jit, part
from sounder.kernels.extraction.fit_path import update_path
from sounder.kernels.extraction.peak_search import (
    Search,
    expect_remainder,
    highest_peak,
    search_around,
    search_block,
)
from sounder.kernels.extraction.pulse import Cir
from sounder.kernels.extraction.records import ARRIVAL, DEPARTURE, OVERLAP, Paths
from sounder.kernels.extraction.scan_view import AntennaView, ScanView, link_gain, toward_path
from sounder.kernels.extraction.workspace import Workspace


class Effort(NamedTuple):
    """What is done about paths that overlap.

    Attributes
    ----------
    removes : int
        1 if paths are subtracted from the beams, else 0.
    refits : int
        How often the paths that share samples with a new one are fitted again.
    passes : int
        How often all paths are fitted again in the end.
    """

    removes: int
    refits: int
    passes: int


@jit
def cancel(
    cir: Cir, view: ScanView, effort: Effort, work: Workspace, search: Search, found: Paths, removed: Cir
) -> tuple[int, bool]:
    """Extract paths from the CIRs of all links; ``cir`` becomes the residual.

    Parameters
    ----------
    cir : array (link, delay)
        CIRs; NaN rows are links that were not recorded.
    view : ScanView
    effort : Effort
    work, search : Workspace, Search
        From `workspace` and `new_search`.
    found : array of `PATH` (capacity, 2)
        Filled with the arrivals and departures of the paths.
    removed : array (capacity, link)
        Filled with the amplitude that was subtracted from each link.

    Returns
    -------
    count : int
        Number of paths.
    complete : bool
        False where peaks were left when ``found`` was full.
    """
    n_beams, n_delays = cir.shape
    period = float(n_delays)
    n_blocks = search.peak.shape[1]
    capacity = found.shape[0]
    removes = effort.removes != 0
    for b in range(n_beams):
        for block in range(n_blocks):
            search_block(cir, view, search, b, block)
    reach = 3 * view.arrival.azimuth_reach, 3 * view.departure.azimuth_reach
    count = 0 * capacity  # a literal would have every part that takes it compiled twice
    for _ in range(4 * capacity):  # every round takes at least one peak away
        b, block = highest_peak(search.peak)
        if count == capacity or search.peak[b, block] <= 0.0:
            break
        k = search.delay[b, block]
        path, arrival = found[count], found[count, ARRIVAL]
        arrival.beam, arrival.delay, arrival.search_angles = b, k, True
        for each in range(n_beams):
            removed[count, each] = 0
        update_path(cir, view, work, path, removed, count, removes)
        expect_remainder(view, work, search, path)
        for copy in range(view.artefacts.size):
            search_around(cir, view, work, search, arrival.delay + view.artefacts[copy].delay)
        search.remainder[b, k] = np.inf
        if _is_duplicate(found, count, view, period):
            search_around(cir, view, work, search, arrival.delay)
            continue
        count += 1
        # Paths that overlap disturb each other's fits, and their residuals look like further paths. So such groups are
        # fitted again at once, before their residuals are searched.
        for _ in range(effort.refits):
            for i in range(count):
                if _share_samples(found[i], path, reach, period):
                    found[i, ARRIVAL].search_angles = False
                    update_path(cir, view, work, found[i], removed, i, removes)
        for i in range(count):
            if _share_samples(found[i], path, reach, period):
                search_around(cir, view, work, search, found[i, ARRIVAL].delay)
    b, block = highest_peak(search.peak)
    complete = search.peak[b, block] <= 0.0
    for number in range(effort.passes):
        for i in range(count):
            found[i, ARRIVAL].search_angles = number == 0
            update_path(cir, view, work, found[i], removed, i, removes)
    return _keep(found, removed, count, view, period), complete


@part
def _keep(found: Paths, removed: Cir, count: int, view: ScanView, period: float) -> int:
    """Move the paths that still exceed the threshold to the front; some no longer do after they were fitted again."""
    kept = 0
    for i in range(count):
        path = found[i, ARRIVAL]
        amplitude = path.amplitude * path.beam_gain
        above = amplitude * amplitude > view.links[path.beam].threshold
        if above and not _is_artefact(found, count, i, view, period):
            for end in range(2):
                found[kept, end] = found[i, end]
            for b in range(removed.shape[1]):
                removed[kept, b] = removed[i, b]
            kept += 1
    return kept


@part
def _is_artefact(found: Paths, count: int, i: int, view: ScanView, period: float) -> bool:
    """Whether a path is a copy that the instrument makes of another."""
    path = found[i, ARRIVAL]
    for copy in range(view.artefacts.size):
        artefact = view.artefacts[copy]
        for j in range(count):
            other = found[j, ARRIVAL]
            if _circular_distance(path.delay, other.delay + artefact.delay, period) < view.delay_resolution:
                g = link_gain(view, path.beam, toward_path(found[j]))
                if path.amplitude * path.beam_gain < artefact.amplitude * (other.amplitude * g):
                    return True
    return False


@part
def _share_samples(path: Paths, other: Paths, reach: tuple[float, float], period: float) -> bool:
    """Whether two paths are fitted to samples that both are in."""
    return (
        _circular_distance(path[ARRIVAL].delay, other[ARRIVAL].delay, period) < OVERLAP
        and _circular_distance(path[ARRIVAL].azimuth, other[ARRIVAL].azimuth, 360.0) < reach[ARRIVAL]
        and _circular_distance(path[DEPARTURE].azimuth, other[DEPARTURE].azimuth, 360.0) < reach[DEPARTURE]
    )


@part
def _circular_distance(x: float, y: float, period: float) -> float:
    late = abs(x - y) % period
    return period - late if 2 * late > period else late


@part
def _is_duplicate(found: Paths, count: int, view: ScanView, period: float) -> bool:
    """Whether the last path is one of those found before."""
    delay = found[count, ARRIVAL].delay
    for i in range(count):
        close = _circular_distance(found[i, ARRIVAL].delay, delay, period) < view.delay_resolution
        if (
            close
            and _is_near(view.arrival, found[i], found[count])
            and _is_near(view.departure, found[i], found[count])
        ):
            return True
    return False


@part
def _is_near(antenna: AntennaView, path: Paths, other: Paths) -> bool:
    """Whether the directions of two paths at one end are within its resolution."""
    one, two = path[antenna.end], other[antenna.end]
    aside = _circular_distance(one.azimuth, two.azimuth, 360.0)
    return aside < antenna.azimuth_resolution and abs(one.elevation - two.elevation) < antenna.elevation_resolution
