"""Many lists in one array: what each of many lines, links or points has, so that all are worked on in one go."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.paths import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Ragged:
    """Lists of row numbers, one after another.

    Parameters
    ----------
    rows : array (row,) of int
        Those of the first list, then those of the second, and so on.
    start : array (list + 1,) of int
        Where each list starts, and the end of the last.
    """

    rows: IntArray
    start: IntArray

    @classmethod
    def of_pairs(cls, owner: IntArray, rows: IntArray, count: int) -> "Ragged":
        """Return the rows of each of ``count`` owners, whose numbers (row,) ascend."""
        return cls(rows, np.searchsorted(owner, np.arange(count + 1)))

    @classmethod
    def of_lists(cls, lists: list[IntArray]) -> "Ragged":
        """Return lists as one."""
        start = np.cumsum([0, *(len(one) for one in lists)])
        return cls(concatenated(lists), start)

    @classmethod
    def gathered(cls, owners: list[IntArray], rows: list[IntArray], count: int) -> "Ragged":
        """Return the rows of each of ``count`` owners from parts, in the order of these; owners need not ascend."""
        owner = concatenated(owners)
        order = np.argsort(owner, kind="stable")
        return cls.of_pairs(owner[order], concatenated(rows)[order], count)

    def __len__(self) -> int:
        return len(self.start) - 1

    def __getitem__(self, number: int) -> IntArray:
        return self.rows[self.start[number] : self.start[number + 1]]

    def __iter__(self) -> Iterator[IntArray]:
        return (self.rows[a:b] for a, b in zip(self.start[:-1].tolist(), self.start[1:].tolist(), strict=True))

    @property
    def sizes(self) -> IntArray:
        """Length (list,) of each."""
        return np.diff(self.start)

    @property
    def owner(self) -> IntArray:
        """Number (row,) of the list that each row is in."""
        return np.repeat(np.arange(len(self)), self.sizes)

    def take(self, lists: IntArray) -> "Ragged":
        """Return some of the lists, in the order given; one may come twice."""
        first = self.start[lists]
        sizes = self.start[1:][lists] - first  # and not of all lists, which may be a million
        start = np.concatenate([[0], np.cumsum(sizes)])
        return Ragged(self.rows[np.arange(start[-1]) + np.repeat(first - start[:-1], sizes)], start)

    def kept(self, mask: BoolArray) -> "Ragged":
        """Return the lists without the rows that a mask (row,) leaves out."""
        return Ragged(self.rows[mask], np.concatenate([[0], np.cumsum(mask)])[self.start])

    def distinct(self, key: IntArray) -> IntArray:
        """Number (list,) of different keys, given for all rows there are, among those of each list."""
        span = int(key.max(initial=0)) + 1
        pairs = np.sort(self.owner * span + key[self.rows])
        return np.bincount(pairs[first_of_each(pairs)] // span, minlength=len(self))

    def same(self, other: "Ragged") -> BoolArray:
        """Whether (list,) lists are those of another as many."""
        same = self.sizes == other.sizes
        mine, theirs = (one.take(np.flatnonzero(same)) for one in (self, other))
        different = mine.owner[mine.rows != theirs.rows]
        same[np.flatnonzero(same)[different]] = False
        return same

    def part(self, lists: slice) -> "Ragged":
        """Return consecutive lists."""
        start = self.start[lists.start : lists.stop + 1]
        return Ragged(self.rows[start[0] : start[-1]], start - start[0])

    def parts(self, most: int) -> Iterator[slice]:
        """Slices of lists that together have about as many rows, one list at least."""
        edges = np.searchsorted(self.start, np.arange(0, self.start[-1], most))
        edges = np.unique(np.concatenate([edges, [len(self)]])) if len(self) else np.zeros(1, dtype=np.int64)
        return (slice(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def concatenated(lists: Iterable[IntArray]) -> IntArray:
    """Row numbers of lists one after another; an empty array of none."""
    return np.concatenate([np.empty(0, dtype=np.int64), *lists])


def sums(values: FloatArray, start: IntArray) -> FloatArray:
    """Sum (list, ...) of the values (row, ...) of lists; 0 of an empty one."""
    total = np.zeros((len(start) - 1, *values.shape[1:]))
    some = np.flatnonzero(np.diff(start))
    if len(some):
        total[some] = np.add.reduceat(values, start[some], axis=0)
    return total


def first_of_each(key: IntArray) -> BoolArray:
    """Where (row,) a sorted key changes."""
    first = np.ones(len(key), dtype=bool)
    np.not_equal(key[1:], key[:-1], out=first[1:])
    return first
