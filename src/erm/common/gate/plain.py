"""Numbers that stand plainly in a file, read piece by piece."""

import operator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.gate.limits import current, too_large


@dataclass(frozen=True)
class PlainNumbers:
    """Array in a file, in C order. Only what is asked for is read, without a memory map.

    Attributes
    ----------
    path : Path
    dtype : numpy.dtype
        As stored; what is read has the byte order of this machine.
    shape : tuple of int
    offset : int
        Place of the first number in the file [byte].

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "samples.bin"
    ...     np.arange(12, dtype=">i2").tofile(path)
    ...     PlainNumbers(path, np.dtype(">i2"), (3, 4))[1, ::2].tolist()
    [4, 6]
    """

    path: Path
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    offset: int = 0

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)

    def __getitem__(self, index: Any) -> NDArray[Any]:
        """Read what integers and slices select; the first slice limits what is read."""
        start, shape, rest = one_piece(self.shape, index)
        count, item = prod(shape), self.dtype.itemsize
        if count * item > current().max_bytes:
            raise DataError(f"{self.path}: a piece of the samples {too_large(count * item)}")
        try:
            found = np.fromfile(self.path, self.dtype, count, offset=self.offset + start * item)
        except OSError as error:
            raise DataError(f"{self.path}: cannot be read ({error.strerror}); copy it again") from None
        if found.size < count:
            raise DataError(f"{self.path}: became shorter while it was read; copy it again")
        return found.astype(self.dtype.newbyteorder("=")).reshape(shape)[rest]


@dataclass(frozen=True)
class Rows:
    """Array of which a row holds all elements one after another.

    Attributes
    ----------
    row : PlainNumbers, Dataset or array (element, ...)
    shape : tuple of int
        Axes in place of the first one of ``row``.
    start : int
        First element that belongs to it.
    stride : int
        Elements from one row of the last axis to the next; its length or more.
    """

    row: Any
    shape: tuple[int, ...]
    start: int
    stride: int

    def __getitem__(self, index: Any) -> NDArray[Any]:
        """Read what integers and slices select along the axes of ``shape``; the last of them must be a slice."""
        *most, length = self.shape
        begin, shape, rest = one_piece((*most, self.stride), index)
        first, count = self.start + begin, prod(shape)
        piece = np.asarray(self.row[first : first + count])
        if missing := count - len(piece):  # the row may end with the last capture
            piece = np.concatenate([piece, np.zeros((missing, *piece.shape[1:]), piece.dtype)])
        rows = piece.reshape(*shape, *piece.shape[1:])
        return rows[(slice(None),) * (len(shape) - 1) + (slice(length),)][rest]


@dataclass(frozen=True)
class Apart:
    """Array of which an axis can hold several, of which the first changes last.

    Attributes
    ----------
    node : PlainNumbers, Dataset or array
    shape : tuple of tuple of int
        Lengths of the axes that lie along each axis of ``node``.

    Examples
    --------
    >>> Apart(np.arange(24).reshape(2, 12), ((2,), (3, 4)))[1, slice(None), 2].tolist()
    [14, 18, 22]
    """

    node: Any
    shape: tuple[tuple[int, ...], ...]

    def __getitem__(self, index: tuple[int | slice, ...]) -> NDArray[Any]:
        """Read what integers and slices select, one for each axis."""
        places: list[int | slice | list[int]] = []
        lengths: list[int] = []
        parts = iter(index)
        for along in self.shape:
            own = [next(parts) for _ in along]
            chosen = [np.atleast_1d(np.arange(length)[part]) for length, part in zip(along, own, strict=True)]
            place = np.ravel_multi_index(np.meshgrid(*chosen, indexing="ij"), along).ravel()
            kept = [each.size for each, part in zip(chosen, own, strict=True) if isinstance(part, slice)]
            lengths += kept
            places.append(_as_slice(place) if kept else int(place[0]))
        return np.asarray(self.node[tuple(places)]).reshape(lengths)


def _as_slice(place: NDArray[np.intp]) -> slice | list[int]:
    """Places as a slice if they are evenly spaced: not every array takes a list."""
    step = int(place[1] - place[0]) if place.size > 1 else 1
    even = place.size > 0 and step > 0 and (np.diff(place) == step).all()
    return slice(int(place[0]), int(place[-1]) + 1, step) if even else place.tolist()


def one_piece(shape: tuple[int, ...], index: Any) -> tuple[int, tuple[int, ...], tuple[slice | int, ...]]:
    """Smallest piece in one row that integers and slices select from, up to the first slice.

    Returns
    -------
    start : int
        First element of the piece.
    piece : tuple of int
        Its shape.
    rest : tuple
        What is then selected from it.

    Examples
    --------
    >>> one_piece((4, 10, 8), (2, slice(3, 5), slice(0, 8, 2)))
    (184, (2, 8), (slice(None, None, 1), slice(0, 8, 2)))
    """
    parts = index if isinstance(index, tuple) else (index,)
    parts += (slice(None),) * (len(shape) - len(parts))
    start = 0
    while shape and not isinstance(parts[0], slice):
        start += range(shape[0])[operator.index(parts[0])] * prod(shape[1:])
        parts, shape = parts[1:], shape[1:]
    if not shape:
        return start, shape, parts
    wanted = range(*parts[0].indices(shape[0]))
    low, high = (min(wanted[0], wanted[-1]), max(wanted[0], wanted[-1]) + 1) if wanted else (0, 0)
    return start + low * prod(shape[1:]), (high - low, *shape[1:]), (slice(None, None, wanted.step), *parts[1:])
