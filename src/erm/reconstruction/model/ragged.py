"""Many lists in one array (a ragged array), so that all are worked on at once."""

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

    Examples
    --------
    >>> lists = Ragged.from_lists([np.array([4, 7]), np.array([], dtype=int), np.array([7])])
    >>> lists.sizes.tolist(), lists.owner.tolist(), lists[0].tolist()
    ([2, 0, 1], [0, 0, 2], [4, 7])
    """

    rows: IntArray
    start: IntArray

    @classmethod
    def from_pairs(cls, owner: IntArray, rows: IntArray, count: int) -> "Ragged":
        """Return the rows of each of ``count`` lists; their numbers ``owner`` (row,) ascend."""
        return cls(rows, np.searchsorted(owner, np.arange(count + 1)))

    @classmethod
    def from_lists(cls, lists: list[IntArray]) -> "Ragged":
        """Return lists as one."""
        start = np.cumsum([0, *(len(one) for one in lists)])
        return cls(concatenate_rows(lists), start)

    @classmethod
    def from_parts(cls, owners: list[IntArray], rows: list[IntArray], count: int) -> "Ragged":
        """Return the rows of each of ``count`` lists, given in parts in this order; owners need not ascend."""
        owner = concatenate_rows(owners)
        order = np.argsort(owner, kind="stable")
        return cls.from_pairs(owner[order], concatenate_rows(rows)[order], count)

    @classmethod
    def empty(cls, count: int) -> "Ragged":
        """Return ``count`` lists without rows."""
        return cls(np.empty(0, dtype=np.int64), np.zeros(count + 1, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.start) - 1

    def __getitem__(self, number: int) -> IntArray:
        return self.rows[self.start[number] : self.start[number + 1]]

    def __iter__(self) -> Iterator[IntArray]:
        return (self.rows[a:b] for a, b in zip(self.start[:-1].tolist(), self.start[1:].tolist(), strict=True))

    @property
    def sizes(self) -> IntArray:
        """Length (list,) of each list."""
        return np.diff(self.start)

    @property
    def owner(self) -> IntArray:
        """Number (row,) of the list that each row is in."""
        return np.repeat(np.arange(len(self)), self.sizes)

    def take(self, lists: IntArray) -> "Ragged":
        """Return some of the lists, in the order given; a list may be taken twice."""
        first = self.start[lists]
        sizes = self.start[1:][lists] - first  # and not of all lists, which may be a million
        start = np.concatenate([[0], np.cumsum(sizes)])
        return Ragged(self.rows[np.arange(start[-1]) + np.repeat(first - start[:-1], sizes)], start)

    def masked(self, mask: BoolArray) -> "Ragged":
        """Return the lists with only the rows of a mask (row,)."""
        return Ragged(self.rows[mask], np.concatenate([[0], np.cumsum(mask)])[self.start])

    def count_distinct(self, key: IntArray) -> IntArray:
        """Number (list,) of different keys in each list; ``key`` is that of every possible row."""
        span = int(key.max(initial=0)) + 1
        pairs = np.sort(self.owner * span + key[self.rows])
        return np.bincount(pairs[first_of_each(pairs)] // span, minlength=len(self))

    def equals(self, other: "Ragged") -> BoolArray:
        """Whether (list,) each list is equal to that of another ragged array of as many lists."""
        equal = self.sizes == other.sizes
        mine, theirs = (one.take(np.flatnonzero(equal)) for one in (self, other))
        different = mine.owner[mine.rows != theirs.rows]
        equal[np.flatnonzero(equal)[different]] = False
        return equal

    def batch(self, lists: slice) -> "Ragged":
        """Return consecutive lists."""
        start = self.start[lists.start : lists.stop + 1]
        return Ragged(self.rows[start[0] : start[-1]], start - start[0])

    def batches(self, rows: int) -> Iterator[slice]:
        """Slices of lists that together have about so many rows; each has at least one list."""
        edges = np.searchsorted(self.start, np.arange(0, self.start[-1], rows))
        edges = np.unique(np.concatenate([edges, [len(self)]])) if len(self) else np.zeros(1, dtype=np.int64)
        return (slice(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def concatenate_rows(lists: Iterable[IntArray]) -> IntArray:
    """Row numbers of lists one after another; an empty array if there is no list."""
    return np.concatenate([np.empty(0, dtype=np.int64), *lists])


def list_sums(values: FloatArray, start: IntArray) -> FloatArray:
    """Sum (list, ...) of the values (row, ...) of each list; 0 of an empty list."""
    total = np.zeros((len(start) - 1, *values.shape[1:]))
    filled = np.flatnonzero(np.diff(start))
    if len(filled):
        total[filled] = np.add.reduceat(values, start[filled], axis=0)
    return total


def first_of_each(key: IntArray) -> BoolArray:
    """Mask (row,) of the first row of each value of a sorted key."""
    first = np.ones(len(key), dtype=bool)
    np.not_equal(key[1:], key[:-1], out=first[1:])
    return first
