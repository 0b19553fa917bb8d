"""Greedy selection: groups are taken one after another, each from what the earlier ones left free.

Many trials are made at once. What a trial finds depends on some paths being free. As long as none of these is taken it
would find the same later, so its result is kept; a trial that an earlier group has invalidated is repeated.
"""

from collections.abc import Callable, Collection, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from erm.reconstruction.model.line import Line
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.ragged import Ragged

MIN_BATCH, MAX_BATCH = 64, 2048
"""Trials made at once: few while most of them find a group and so invalidate others. Chosen; not derived."""


class Group(NamedTuple):
    """A line and its inliers: rows of the paths that agree with it, at most one per link."""

    line: Line
    inliers: IntArray


class HasInliers(Protocol):
    """Something that paths agree on."""

    @property
    def inliers(self) -> IntArray:
        """Rows of the paths."""


F = TypeVar("F", bound=HasInliers)


class Trial(NamedTuple, Generic[F]):
    """What a seed would find, if anything, and the paths that must be free for the same result later."""

    found: F | None
    depends_on: IntArray


class GreedySelection(Generic[F]):
    """What has been found, and which paths are free.

    Parameters
    ----------
    row : array (path,) of int
        Row of the table. When one path of a row is taken, all are.
    min_support : int
        Fewest inliers of what is found.
    """

    def __init__(self, row: IntArray, min_support: int) -> None:
        self.found: list[F] = []
        self.free = np.ones(len(row), dtype=bool)
        self._min_support = min_support
        _, self._row = np.unique(row, return_inverse=True)
        order = np.argsort(self._row, kind="stable")
        self._of_row = Ragged.from_pairs(self._row[order], order, int(self._row.max(initial=-1)) + 1)

    def run(
        self,
        order: IntArray,
        try_seeds: Callable[[IntArray, BoolArray], Sequence[Trial[F] | None]],
        partners: Ragged | None = None,
    ) -> None:
        """Take what seeds find, seed after seed.

        Parameters
        ----------
        order : array (seed,) of int
            Seeds in their order.
        try_seeds : callable
            What some seeds (n,) would find while paths (path,) are free. For all but the first it may return None, if
            they are better tried later.
        partners : Ragged, optional
            If seeds are paths: the paths likely to be in one group with each. Seeds that are taken are skipped.
        """
        waiting: dict[int, Trial[F]] = {}
        batch, fruitful = MIN_BATCH, True
        while len(order):
            if partners is not None:
                order = order[self.free[order]]
            chosen = _next_batch(order, waiting, batch, partners if fruitful else None)
            results = zip(chosen, try_seeds(np.array(chosen, dtype=np.int64), self.free), strict=True)
            tried = {seed: trial for seed, trial in results if trial is not None}
            waiting |= tried
            used = passed = 0
            before = len(self.found)
            for seed in order.tolist():
                if partners is None or self.free[seed]:
                    # no trial is invalid as long as nothing is found
                    if seed not in waiting or not (len(self.found) == before or self._is_valid(waiting[seed])):
                        break
                    self._accept(waiting.pop(seed).found)
                    used += 1
                passed += 1
            order = order[passed:]
            if len(self.found) > before:
                waiting = {
                    seed: trial
                    for seed, trial in waiting.items()
                    if self._is_valid(trial) and (partners is None or self.free[seed])
                }
            fruitful = len(self.found) - before > used / 2
            batch = min(2 * batch, MAX_BATCH) if used > 0.7 * len(tried) else max(batch // 2, MIN_BATCH)

    def _is_valid(self, trial: Trial[F]) -> bool:
        return bool(self.free[trial.depends_on].all())

    def _accept(self, found: F | None) -> None:
        if found is not None and len(found.inliers) >= self._min_support:
            self.found.append(found)
            self.free[self._of_row.take(self._row[found.inliers]).rows] = False


def _next_batch(order: IntArray, waiting: Collection[int], batch: int, partners: Ragged | None) -> list[int]:
    """The next seeds that have not been tried, without those likely to be taken by a group of an earlier one."""
    room = max(batch - len(waiting), batch // 4)
    chosen: list[int] = []
    expected: set[int] = set()
    for seed in order[: 4 * batch].tolist():
        if seed in waiting or seed in expected:
            continue
        chosen.append(seed)
        if len(chosen) == room:
            break
        if partners is not None:
            expected.update(partners[seed].tolist())
    return chosen
