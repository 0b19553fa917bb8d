"""Groups taken in turns, each from what the earlier ones left, although many are tried at once.

What a trial finds depends on some paths being free. As long as none of these is taken, it finds the same later; so
trials are made ahead of their turn, and those that an earlier group has spoiled are made again.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from erm.walls.line import Line
from erm.walls.paths import BoolArray, IntArray
from erm.walls.ragged import Ragged

FEW, MANY = 64, 2048  # trials made in one go: few while most find a group, and so spoil others


class Group(NamedTuple):
    """A line and the paths that agree with it, at most one a link."""

    line: Line
    members: IntArray


class Trial(NamedTuple):
    """A group that a turn would find, if the paths that it has seen are free when it comes."""

    group: Group | None
    seen: IntArray


class Turns:
    """What has been found and what is free.

    Parameters
    ----------
    row : array (path,) of int
        Row of the table; when one path of a row is taken, all are.
    min_support : int
        Fewest members of a group.
    """

    def __init__(self, row: IntArray, min_support: int) -> None:
        self.groups: list[Group] = []
        self.free = np.ones(len(row), dtype=bool)
        self._min_support = min_support
        _, self._row = np.unique(row, return_inverse=True)
        order = np.argsort(self._row, kind="stable")
        self._of_row = Ragged.of_pairs(self._row[order], order, int(self._row.max(initial=-1)) + 1)

    def take(
        self,
        order: IntArray,
        trials: Callable[[IntArray, BoolArray], list[Trial]],
        partners: Ragged | None = None,
    ) -> None:
        """Let each have its turn.

        Parameters
        ----------
        order : array (turn,) of int
            Whose turn it is.
        trials : callable
            What some of them (some,) would find while paths (path,) are free.
        partners : Ragged, optional
            If they are paths: those likely to be in one group with each. Paths that are taken lose their turn.
        """
        waiting: dict[int, Trial] = {}
        many = FEW
        while len(order):
            if partners is not None:
                order = order[self.free[order]]
            chosen = _ahead(order, waiting, many, partners)
            waiting |= zip(chosen, trials(np.array(chosen, dtype=np.int64), self.free), strict=True)
            done = gone = 0
            for one in order.tolist():
                if partners is None or self.free[one]:
                    if one not in waiting or not self.free[waiting[one].seen].all():
                        break
                    self._keep(waiting.pop(one).group)
                    done += 1
                gone += 1
            order = order[gone:]
            waiting = {
                one: trial
                for one, trial in waiting.items()
                if self.free[trial.seen].all() and (partners is None or self.free[one])
            }
            many = min(2 * many, MANY) if done > 0.7 * len(chosen) else max(many // 2, FEW)

    def _keep(self, group: Group | None) -> None:
        if group is not None and len(group.members) >= self._min_support:
            self.groups.append(group)
            self.free[self._of_row.take(self._row[group.members]).rows] = False


def _ahead(order: IntArray, waiting: dict[int, Trial], many: int, partners: Ragged | None) -> list[int]:
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
