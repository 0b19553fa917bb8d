"""Refine lines: collect the paths that agree with each and fit it to them, alternately; many lines at once."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import CHI_SQUARED_GATE, MAX_STEPS, fit_lines, misfits
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.ragged import Ragged, first_of_each
from erm.reconstruction.search.images import BATCH_LINES, Images

MAX_REFINEMENTS = 12
"""Repetitions of collecting and fitting. Chosen; not derived."""
ROUGH_FIT_STEPS = 5
"""Steps of a fit whose inliers may still change. Chosen; not derived."""
CHI_SQUARED_PER_DECIBEL = 0.5
"""Penalty of reflection loss [1/dB]: of two paths of a link inside the gate, a much stronger one is the wall's. Chosen;
not derived."""


class RefinedGroups(NamedTuple):
    """Lines and the paths that agree with them."""

    lines: Lines
    inliers: Ragged  # ascending; fewer than two where a line found nothing to agree with
    depends_on: Ragged  # paths that were collected on the way: whether others are free makes no difference
    deferred: BoolArray  # lines that were not refined, for an earlier one is likely to take their seeds


def refine_groups(
    images: Images, lines: Lines, free: BoolArray, seeds: IntArray | None = None, before: Ragged | None = None
) -> RefinedGroups:
    """Let each line collect the free paths that agree with it, and fit it to them, until they no longer change.

    Parameters
    ----------
    images : Images
    lines : Lines
    free : array (path,) of bool
    seeds : array (line,) of int, optional
        Paths that the lines start from. A line whose seed an earlier line collects at once is deferred.
    before : Ragged, optional
        Paths that the lines were fitted to. A line that collects the same paths has converged.
    """
    count = len(lines.normal)
    deferred = np.zeros(count, dtype=bool) if seeds is None else _seeds_taken_before(images, lines, free, seeds)
    active = np.flatnonzero(~deferred)
    before = Ragged.empty(len(active)) if before is None else before.take(active)
    owners: list[IntArray] = []
    rows: list[IntArray] = []
    final: list[tuple[IntArray, IntArray]] = []  # owners and rows of the final inliers
    for repetition in range(MAX_REFINEMENTS + 1):
        collected, _ = collect_inliers(images, lines.take(active), free)
        owners.append(active[collected.owner])
        rows.append(collected.rows)
        converged = collected.equals(before)
        enough = collected.sizes > 1
        ends = converged | ~enough | (repetition == MAX_REFINEMENTS)
        own = collected.take(np.flatnonzero(ends))
        final.append((active[ends][own.owner], own.rows))
        if repetition == MAX_REFINEMENTS:
            break
        active, converged, before = active[enough], converged[enough], collected.take(np.flatnonzero(enough))
        steps = np.where(converged, MAX_STEPS, ROUGH_FIT_STEPS)
        lines = lines.with_replaced(active, fit_lines(images.paths.columns, before, lines.take(active), steps))
        active, before = active[~converged], before.take(np.flatnonzero(~converged))
        if len(active) == 0:
            break
    inliers = Ragged.from_parts([one for one, _ in final], [own for _, own in final], count)
    return RefinedGroups(lines, inliers, Ragged.from_parts(owners, rows, count), deferred)


def _seeds_taken_before(images: Images, lines: Lines, free: BoolArray, seeds: IntArray) -> BoolArray:
    """Whether (line,) an earlier line, whose own seed is not taken, collects the seed of each line at once."""
    collected, _ = collect_inliers(images.restricted_to(np.sort(seeds)), lines, free)
    line_of = np.full(len(images.paths), -1)
    line_of[seeds] = np.arange(len(seeds))
    by, of = collected.owner, line_of[collected.rows]
    taken = np.zeros(len(seeds), dtype=bool)
    for one, other in zip(by[of > by].tolist(), of[of > by].tolist(), strict=True):
        taken[other] |= not taken[one]
    return taken


def collect_inliers(images: Images, lines: Lines, free: BoolArray) -> tuple[Ragged, FloatArray]:
    """Collect the free paths inside the gate of each line, the best one of each link.

    Returns
    -------
    inliers : Ragged
        Ascending.
    chi_squared : array (row,)
        Of each inlier, with the penalties of its loss and elevation left out.
    """
    batches = [
        _collect_inliers(images, lines.take(slice(first, first + BATCH_LINES)), free)
        for first in range(0, len(lines.normal), BATCH_LINES)
    ]
    if len(batches) == 1:
        return batches[0]
    start = np.cumsum([0, *(size for part, _ in batches for size in part.sizes.tolist())])
    rows, chi2 = [part.rows for part, _ in batches], [values for _, values in batches]
    nothing = np.empty(0)
    return Ragged(np.concatenate([nothing.astype(np.int64), *rows]), start), np.concatenate([nothing, *chi2])


def _collect_inliers(images: Images, lines: Lines, free: BoolArray) -> tuple[Ragged, FloatArray]:
    paths = images.paths
    of, rows = images.near_lines(lines)
    of, rows = of[free[rows]], rows[free[rows]]
    chi2 = misfits(paths.columns, rows, lines, of)
    inside = np.flatnonzero(chi2 < CHI_SQUARED_GATE)
    of, rows, chi2 = of[inside], rows[inside], chi2[inside]
    # the denser of two paths of a link there, not the one of the larger errors: -2 ln of the density of errors
    spread = 2 * np.log(paths.length_std[rows] * paths.azimuth_std[rows])
    cost = chi2 + spread + CHI_SQUARED_PER_DECIBEL * paths.loss[rows] + paths.elevation_misfit[rows]
    best = best_of_each_link(of, paths.link[rows], rows, cost)
    return Ragged.from_pairs(of[best], rows[best], len(lines.normal)), chi2[best]


def best_of_each_link(of: IntArray, link: IntArray, rows: IntArray, cost: FloatArray) -> IntArray:
    """Pairs (index,) with the lowest cost for each owner ``of`` and link, ordered by owner and row.

    Parameters
    ----------
    of, link, rows : array (pair,) of int
        Owner, link of the path, and row of the path.
    cost : array (pair,)
        Of equal costs the lowest row wins.
    """
    key = of * (link.max(initial=0) + 1) + link
    rank = np.lexsort((rows, cost, key))
    best = rank[first_of_each(key[rank])]
    return best[np.lexsort((rows[best], of[best]))]
