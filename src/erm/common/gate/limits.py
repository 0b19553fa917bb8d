"""What a file may cost, and what it may ask for, unless the user allows more."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

GIB = 2**30
MAX_TEXT = 2**24
"""Largest attribute, description or set of metadata that is read [byte]; chosen: 200 000 frequencies of touchstone, a
fine antenna grid."""
EXPANSION = 3
"""Memory of a parser relative to what it reads: the packed file, the unpacked bytes and the arrays."""


@dataclass(frozen=True)
class Limits:
    """Limits of one process.

    Attributes
    ----------
    max_bytes : int
        Largest array, and largest file of text, that is loaded in one piece [byte]. The default is chosen: no command
        takes more than 2 GiB, as reading and converting an array takes up to three times its size.
    virtual : bool
        Whether virtual HDF5 datasets are read. Their data are in other files, of the same folder or below it.
    """

    max_bytes: int = GIB // 2
    virtual: bool = False


_current = Limits()


def current() -> Limits:
    """Limits that hold now."""
    return _current


def allow(limits: Limits) -> None:
    """Set the limits of this process."""
    global _current
    _current = limits


@contextmanager
def allowed(**changes: Any) -> Iterator[Limits]:
    """Change limits for the time of a block.

    Examples
    --------
    >>> with allowed(virtual=True) as limits:
    ...     current().virtual, limits.max_bytes
    (True, 536870912)
    """
    before = _current
    allow(replace(before, **changes))
    try:
        yield _current
    finally:
        allow(before)


def size(count: float) -> str:
    """Write a number of bytes: ``3.0 GiB``; 8 EiB for all that no machine can address."""
    count = min(count, sys.maxsize)  # an integer of a text has any number of digits
    unit = "B"
    for unit in ("B", "KiB", "MiB", "GiB", "TiB"):
        if count < 1024 or unit == "TiB":
            break
        count /= 1024
    return f"{count:.1f} {unit}" if unit != "B" else f"{count:g} B"


def too_large(count: float) -> str:
    """Say that something is too large, and which option admits it."""
    wanted = min(count, sys.maxsize) / GIB
    option = f"{wanted:.2g}" if wanted < 10 else f"{wanted:.0f}"
    return (
        f"needs {size(count)}, more than the limit of {size(_current.max_bytes)}; if you trust the file, raise it with "
        f"--max-memory {option} before the command"
    )
