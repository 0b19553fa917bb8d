"""Successive cancellation: find the strongest path, fit it, subtract it from every beam, and repeat.

A path of amplitude ``a`` from direction ``w`` at delay ``d`` appears in every beam ``b`` as ``a g(w - w_b) p(t - d)``
with a phase of its own, since the phase drifts while the horn turns. The complex amplitude is therefore fitted in each
beam, and used if its magnitude is no more than a margin times what the pattern allows. So the sidelobes of a path, in
angle and in delay, are subtracted with it, and another path that arrives at the same time stays.
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
from sounder.kernels.extraction.records import OVERLAP, Path, Paths
from sounder.kernels.extraction.scan_view import ScanView, pattern, toward
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
    """Extract paths from the CIRs of all beams; ``cir`` becomes the residual.

    Parameters
    ----------
    cir : array (beam, delay)
        CIRs, azimuth-major; NaN rows are beams that were not recorded.
    view : ScanView
    effort : Effort
    work, search : Workspace, Search
        From `workspace` and `new_search`.
    found : array of `PATH` (capacity,)
        Filled with the paths.
    removed : array (capacity, beam)
        Filled with the amplitude that was subtracted from each beam.

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
    capacity = found.size
    removes = effort.removes != 0
    for b in range(n_beams):
        for block in range(n_blocks):
            search_block(cir, view, search, b, block)
    reach = 3 * view.azimuth_reach
    count = 0 * capacity  # a literal would have every part that takes it compiled twice
    for _ in range(4 * capacity):  # every round takes at least one peak away
        b, block = highest_peak(search.peak)
        if count == capacity or search.peak[b, block] <= 0.0:
            break
        k = search.delay[b, block]
        path = found[count]
        path.beam, path.delay, path.search_angles = b, k, True
        for each in range(n_beams):
            removed[count, each] = 0
        update_path(cir, view, work, path, removed, count, removes)
        expect_remainder(view, work, search, path)
        for copy in range(view.artefacts.size):
            search_around(cir, view, work, search, path.delay + view.artefacts[copy].delay)
        search.remainder[b, k] = np.inf
        if _is_duplicate(found, count, view, period):
            search_around(cir, view, work, search, path.delay)
            continue
        count += 1
        # Paths that overlap disturb each other's fits, and their residuals look like further paths. So such groups are
        # fitted again at once, before their residuals are searched.
        for _ in range(effort.refits):
            for i in range(count):
                if _share_samples(found[i], path, reach, period):
                    found[i].search_angles = False
                    update_path(cir, view, work, found[i], removed, i, removes)
        for i in range(count):
            if _share_samples(found[i], path, reach, period):
                search_around(cir, view, work, search, found[i].delay)
    b, block = highest_peak(search.peak)
    complete = search.peak[b, block] <= 0.0
    for number in range(effort.passes):
        for i in range(count):
            found[i].search_angles = number == 0
            update_path(cir, view, work, found[i], removed, i, removes)
    return _keep(found, removed, count, view, period), complete


@part
def _keep(found: Paths, removed: Cir, count: int, view: ScanView, period: float) -> int:
    """Move the paths that still exceed the threshold to the front; some no longer do after they were fitted again."""
    kept = 0
    for i in range(count):
        amplitude = found[i].amplitude * found[i].beam_gain
        above = amplitude * amplitude > view.beams[found[i].beam].threshold
        if above and not _is_artefact(found, count, i, view, period):
            found[kept] = found[i]
            for b in range(removed.shape[1]):
                removed[kept, b] = removed[i, b]
            kept += 1
    return kept


@part
def _is_artefact(found: Paths, count: int, i: int, view: ScanView, period: float) -> bool:
    """Whether a path is a copy that the instrument makes of another."""
    path = found[i]
    for copy in range(view.artefacts.size):
        artefact = view.artefacts[copy]
        for j in range(count):
            if _circular_distance(path.delay, found[j].delay + artefact.delay, period) < view.delay_resolution:
                g, _, _ = pattern(view, path.beam, toward(found[j].azimuth, found[j].elevation))
                if path.amplitude * path.beam_gain < artefact.amplitude * (found[j].amplitude * g):
                    return True
    return False


@part
def _share_samples(path: Path, other: Path, azimuth: float, period: float) -> bool:
    """Whether two paths are fitted to samples that both are in."""
    return (
        _circular_distance(path.delay, other.delay, period) < OVERLAP
        and _circular_distance(path.azimuth, other.azimuth, 360.0) < azimuth
    )


@part
def _circular_distance(x: float, y: float, period: float) -> float:
    late = abs(x - y) % period
    return period - late if 2 * late > period else late


@part
def _is_duplicate(found: Paths, count: int, view: ScanView, period: float) -> bool:
    """Whether the last path is one of those found before."""
    path = found[count]
    for i in range(count):
        if (
            _circular_distance(found[i].delay, path.delay, period) < view.delay_resolution
            and _circular_distance(found[i].azimuth, path.azimuth, 360.0) < view.azimuth_resolution
            and abs(found[i].elevation - path.elevation) < view.elevation_resolution
        ):
            return True
    return False
