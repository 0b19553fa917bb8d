"""HDF5 files that are written completely or not at all, also on a full disk."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import h5py


class _Output(io.FileIO):
    """A file that hides failed writes from HDF5, which crashes when it cannot close a file, and keeps the error."""

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        length = memoryview(data).nbytes
        try:
            done = 0
            while self.failure is None and done < length:  # a disk that becomes full takes a part first
                done += self._take(memoryview(data).cast("B")[done:])
        except OSError as error:
            self.failure = error
        return length

    def _take(self, data: memoryview) -> int:
        return super().write(data) or 0

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

    with _Output(path, "w+") as output:
        try:
            with h5py.File(output, "w") as file:
                yield file
        finally:
            if output.failure is not None:
                raise output.failure
