"""Locks of folders, which end with the process that holds them, however it ends."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@contextmanager
def lock_of(folder: Path) -> Iterator[bool | None]:
    """Hold the lock of a folder during a block, if nobody else holds it.

    Yields
    ------
    bool or None
        True; False if another process or block holds it; None if the file system or the system has no such locks.

    Raises
    ------
    OSError
        The folder cannot be opened.
    """
    if fcntl is None:
        yield None
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        held: bool | None = True
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            held = False
        except OSError:  # some network disks
            held = None
        yield held
    finally:
        os.close(descriptor)
