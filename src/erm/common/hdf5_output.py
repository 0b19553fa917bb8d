"""HDF5 files that are written completely or not at all, also on a full disk."""

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import h5py

LARGEST_KEPT = 1 << 20
"""Largest block that is kept in memory [byte]: that of HDF5's caches of metadata and chunks, larger ones are data."""


class _Output(io.FileIO):
    """A file that hides failed writes from HDF5, and keeps the error.

    HDF5 crashes when it cannot close a file, or when it reads again what it wrote and finds something else. So all
    blocks after a failed write are kept in memory, but for large ones, which it does not read again.
    """

    failure: OSError | None = None

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._kept: list[tuple[int, bytes]] = []
        self._end = 0

    def write(self, data: Any) -> int:
        block, place, done = memoryview(data).cast("B"), self.tell(), 0
        try:
            while self.failure is None and done < len(block):  # a disk that becomes full takes a part first
                done += self._take(block[done:])
        except OSError as error:
            self.failure = error
        if self.failure is not None:
            if len(block) <= LARGEST_KEPT:
                self._kept.append((place, bytes(block)))
            self._end = max(self._end, place + len(block))
        return len(block)

    def _take(self, data: memoryview) -> int:
        return super().write(data) or 0

    def readinto(self, buffer: Any) -> int:
        into, place = memoryview(buffer).cast("B"), self.tell()
        read = super().readinto(into) or 0
        if self.failure is None:
            return read
        into[read:] = bytes(len(into) - read)
        for at, block in self._kept:
            begin, end = max(at, place), min(at + len(block), place + len(into))
            if begin < end:
                into[begin - place : end - place] = block[begin - at : end - at]
        return len(into)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        place = super().seek(offset, whence)
        return max(place, self._end) if whence == os.SEEK_END else place

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.failure = self.failure or error
            return size or 0


@contextmanager
def new_hdf5(path: Path) -> Iterator["h5py.File"]:
    """Make an HDF5 file.

    Raises
    ------
    OSError
        It cannot be written; what was written is of no use.
    """
    import h5py  # slow to import; --help must stay fast

    with _Output(path) as output:
        try:
            with h5py.File(output, "w") as file:
                yield file
        finally:
            if output.failure is not None:
                raise output.failure
