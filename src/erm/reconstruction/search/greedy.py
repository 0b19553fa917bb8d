"""Groups taken in turns, each from what the earlier ones left, although many are tried at once.

What a trial finds depends on some paths being free. As long as none of these is taken, it finds the same later; so
trials are made ahead of their turn, and those that an earlier group has spoiled are made again.
"""

from collections.abc import Callable, Collection, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from erm.reconstruction.model.line import Line
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.ragged import Ragged

FEW, MANY = 64, 2048  # trials made in one go: few while most find a group, and so spoil others


class Group(NamedTuple):
    """A line and the paths that agree with it, at most one a link."""

    line: Line
    members: IntArray


class Found(Protocol):
    """Something that paths agree on."""

    @property
    def members(self) -> IntArray:
        """Rows of the paths."""


F = TypeVar("F", bound=Found)


class Trial(NamedTuple, Generic[F]):
    """What a turn would find, if anything, and the paths that must be free for it when the turn comes."""

    found: F | None
    seen: IntArray


class Turns(Generic[F]):
    """What has been found and what is free.

    Parameters
    ----------
    row : array (path,) of int
        Row of the table; when one path of a row is taken, all are.
    min_support : int
        Fewest members of what is found.
    """

    def __init__(self, row: IntArray, min_support: int) -> None:
        self.found: list[F] = []
        self.free = np.ones(len(row), dtype=bool)
        self._min_support = min_support
        _, self._row = np.unique(row, return_inverse=True)
        order = np.argsort(self._row, kind="stable")
        self._of_row = Ragged.of_pairs(self._row[order], order, int(self._row.max(initial=-1)) + 1)

    def take(
        self,
        order: IntArray,
        trials: Callable[[IntArray, BoolArray], Sequence[Trial[F] | None]],
        partners: Ragged | None = None,
    ) -> None:
        """Let each have its turn.

        Parameters
        ----------
        order : array (turn,) of int
            Whose turn it is.
        trials : callable
            What some of them (some,) would find while paths (path,) are free; of all but the first None if they are
            better tried later.
        partners : Ragged, optional
            If they are paths: those likely to be in one group with each. Paths that are taken lose their turn.
        """
        waiting: dict[int, Trial[F]] = {}
        many, fruitful = FEW, True
        while len(order):
            if partners is not None:
                order = order[self.free[order]]
            chosen = _ahead(order, waiting, many, partners if fruitful else None)
            made = zip(chosen, trials(np.array(chosen, dtype=np.int64), self.free), strict=True)
            tried = {one: trial for one, trial in made if trial is not None}
            waiting |= tried
            done = gone = 0
            before = len(self.found)
            for one in order.tolist():
                if partners is None or self.free[one]:
                    # nothing is spoiled as long as nothing is found
                    if one not in waiting or not (len(self.found) == before or self.free[waiting[one].seen].all()):
                        break
                    self._keep(waiting.pop(one).found)
                    done += 1
                gone += 1
            order = order[gone:]
            if len(self.found) > before:
                waiting = {
                    one: trial
                    for one, trial in waiting.items()
                    if self.free[trial.seen].all() and (partners is None or self.free[one])
                }
            fruitful = len(self.found) - before > done / 2
            many = min(2 * many, MANY) if done > 0.7 * len(tried) else max(many // 2, FEW)

    def _keep(self, found: F | None) -> None:
        if found is not None and len(found.members) >= self._min_support:
            self.found.append(found)
            self.free[self._of_row.take(self._row[found.members]).rows] = False


def _ahead(order: IntArray, waiting: Collection[int], many: int, partners: Ragged | None) -> list[int]:
    """The next that have not been tried, but for those likely to be taken by one before them."""
    room = max(many - len(waiting), many // 4)
    chosen: list[int] = []
    expected: set[int] = set()
    for one in order[: 4 * many].tolist():
        if one in waiting or one in expected:
            continue
        chosen.append(one)
        if len(chosen) == room:
            break
        if partners is not None:
            expected.update(partners[one].tolist())
    return chosen
