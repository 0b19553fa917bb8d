"""Lines gather the paths that agree with them, many lines in one go."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import STEPS, fit_lines, misfits
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.ragged import Ragged, first_of_each
from erm.reconstruction.search.images import GATE, Images

ROUNDS = 12  # of gathering and fitting
ROUGHLY = 5  # steps of a fit whose members may yet change
DECIBEL = 0.5  # chi-squared a dB: of two paths of a link inside the gate the much stronger one is the wall's
LINES = 64  # looked at in one go


class Settled(NamedTuple):
    """Lines that gathered their paths."""

    lines: Lines
    members: Ragged  # ascending; fewer than two where a line found nothing to agree with
    seen: Ragged  # paths that were gathered on the way: what became of the others makes no difference
    later: BoolArray  # lines that were left alone, as an earlier one is likely to take their seeds


def settle(
    images: Images, lines: Lines, free: BoolArray, seeds: IntArray | None = None, before: Ragged | None = None
) -> Settled:
    """Let lines gather the free paths that agree with them, and fit them to these, until they no longer change.

    Those that start from ``seeds`` (line,) are only begun where an earlier one gathers the seed at once. What lines
    were fitted to ``before`` is settled if they gather the same.
    """
    count = len(lines.normal)
    later = np.zeros(count, dtype=bool) if seeds is None else _taken_before(images, lines, free, seeds)
    going = np.flatnonzero(~later)
    nothing = Ragged(np.empty(0, dtype=np.int64), np.zeros(len(going) + 1, dtype=np.int64))
    before = nothing if before is None else before.take(going)
    owners: list[IntArray] = []
    rows: list[IntArray] = []
    last: list[tuple[IntArray, IntArray]] = []  # owners and rows of what lines ended with
    for turn in range(ROUNDS + 1):
        gathered, _ = gather(images, lines.take(going), free)
        owners.append(going[gathered.owner])
        rows.append(gathered.rows)
        settled = gathered.same(before)
        enough = gathered.sizes > 1
        ends = settled | ~enough | (turn == ROUNDS)
        own = gathered.take(np.flatnonzero(ends))
        last.append((going[ends][own.owner], own.rows))
        if turn == ROUNDS:
            break
        going, settled, before = going[enough], settled[enough], gathered.take(np.flatnonzero(enough))
        fitted = fit_lines(images.paths.rays, before, lines.take(going), np.where(settled, STEPS, ROUGHLY))
        lines = lines.put(going, fitted)
        going, before = going[~settled], before.take(np.flatnonzero(~settled))
        if len(going) == 0:
            break
    members = Ragged.gathered([one for one, _ in last], [own for _, own in last], count)
    return Settled(lines, members, Ragged.gathered(owners, rows, count), later)


def _taken_before(images: Images, lines: Lines, free: BoolArray, seeds: IntArray) -> BoolArray:
    """Whether (line,) an earlier line that is not itself so gathers the seed of each at once."""
    gathered, _ = gather(images.only(np.sort(seeds)), lines, free)
    line_of = np.full(len(images.paths), -1)
    line_of[seeds] = np.arange(len(seeds))
    by, of = gathered.owner, line_of[gathered.rows]
    taken = np.zeros(len(seeds), dtype=bool)
    for one, other in zip(by[of > by].tolist(), of[of > by].tolist(), strict=True):
        taken[other] |= not taken[one]
    return taken


def gather(images: Images, lines: Lines, free: BoolArray) -> tuple[Ragged, FloatArray]:
    """Free paths that agree with lines, the best of each link, ascending; and their chi-squared."""
    found = [
        _gather(images, lines.take(slice(first, first + LINES)), free) for first in range(0, len(lines.normal), LINES)
    ]
    if len(found) == 1:
        return found[0]
    start = np.cumsum([0, *(size for part, _ in found for size in part.sizes.tolist())])
    rows, chi2 = [part.rows for part, _ in found], [values for _, values in found]
    nothing = np.empty(0)
    return Ragged(np.concatenate([nothing.astype(np.int64), *rows]), start), np.concatenate([nothing, *chi2])


def _gather(images: Images, lines: Lines, free: BoolArray) -> tuple[Ragged, FloatArray]:
    paths = images.paths
    of, rows = images.about(lines)
    of, rows = of[free[rows]], rows[free[rows]]
    chi2 = misfits(paths.rays, rows, lines, of)
    inside = np.flatnonzero(chi2 < GATE)
    of, rows, chi2 = of[inside], rows[inside], chi2[inside]
    key = of * (paths.link.max(initial=0) + 1) + paths.link[rows]
    rank = np.lexsort((rows, chi2 + DECIBEL * paths.loss[rows], key))
    best = rank[first_of_each(key[rank])]
    best = best[np.lexsort((rows[best], of[best]))]
    return Ragged.of_pairs(of[best], rows[best], len(lines.normal)), chi2[best]
