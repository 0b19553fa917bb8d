"""Groups of files that stay in memory while many stages read the same files.

Each stage takes paths, so that it can be called alone. A campaign calls ten of them on the same products; opening a
product and checking its members takes longer than what most stages do with it.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

MOST_BYTES = 2**28
"""Most memory of the groups that are kept [byte]: a quarter of the GiB that a campaign may take. The rest is read
again."""


class Kept:
    """Groups by the file that they were read from; a file that was written anew is another."""

    def __init__(self) -> None:
        self._groups: dict[tuple[str, int, int, str], xr.Dataset] = {}
        self._bytes = 0

    def get(self, path: Path, group: str) -> "xr.Dataset | None":
        """Copy of a group that is kept; its arrays are shared, so they cannot be written to."""
        found = self._groups.get(_key(path, group))
        return None if found is None else found.copy(deep=False)

    def add(self, path: Path, group: str, dataset: "xr.Dataset") -> None:
        """Keep a group if there is room."""
        if self._bytes + dataset.nbytes <= MOST_BYTES:
            self._bytes += dataset.nbytes
            for variable in dataset.load().variables.values():  # decoded once, not by each who reads it
                variable.values.setflags(write=False)
            self._groups[_key(path, group)] = dataset.copy(deep=False)


def _key(path: Path, group: str) -> tuple[str, int, int, str]:
    facts = os.stat(path)
    return os.fspath(path), facts.st_mtime_ns, facts.st_size, group


_kept: ContextVar[Kept | None] = ContextVar("kept", default=None)


def kept() -> Kept | None:
    """What is kept now; None outside of `keeping`."""
    return _kept.get()


@contextmanager
def keeping() -> Iterator[None]:
    """Read each group of an unchanged file once meanwhile."""
    token = _kept.set(Kept())
    try:
        yield
    finally:
        _kept.reset(token)
