"""Global heaps of HDF5 files, which hold texts: HDF5 never ends reading one whose list of objects goes in a circle.

A heap is ``GCOL``, version 1, its length, and objects one after another: an index (2 bytes), 6 bytes, the length of the
content (8 bytes), the content padded to 8 bytes. Index 0 is the free rest; its length counts its header. Zeros in the
place of this header say that the next object is where this one is.

References
----------
HDF5 File Format Specification Version 3.0, III.E "Disk Format: Level 1E - Global Heap".
"""

import struct
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

from erm.common.errors import DataError

BEGINNING = b"GCOL\1\0\0\0"
OBJECT = struct.Struct("<H6xQ")
BLOCK = 2**20
"""Piece of a file that is searched at once [byte]; chosen."""


def require_heaps(path: Path) -> None:
    """Refuse an HDF5 file with a global heap that HDF5 would not come to the end of. Unchanged files are read once.

    Raises
    ------
    DataError
        There is such a heap, or the file cannot be read.
    """
    try:
        facts = path.stat()
        damaged = _damaged(str(path), facts.st_mtime_ns, facts.st_size)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); copy it again") from None
    if damaged is not None:
        raise DataError(f"{path}: damaged HDF5 file (texts at byte {damaged}); make or copy it again")


@lru_cache(maxsize=256)
def _damaged(path: str, modified: int, size: int) -> int | None:  # time and size are part of the key of the cache
    """Place of the first damaged heap."""
    with open(path, "rb") as file:
        for place in _heaps(file):
            file.seek(place + len(BEGINNING))
            length = int.from_bytes(file.read(8), "little")
            if length <= size - place and not _ends(file.read(length - OBJECT.size)):
                return place
    return None


def _heaps(file: BinaryIO) -> Iterator[int]:
    """Places of all heaps."""
    first = 0
    while file.seek(first) == first and (block := file.read(BLOCK + len(BEGINNING) - 1)):
        at = block.find(BEGINNING)
        while at >= 0:
            yield first + at
            at = block.find(BEGINNING, at + 1)
        first += BLOCK


def _ends(objects: bytes) -> bool:
    """Whether each object of a heap is followed by another, or by its end."""
    place = 0
    while place + OBJECT.size <= len(objects):
        index, length = OBJECT.unpack_from(objects, place)
        step = OBJECT.size + -(-length // 8) * 8 if index else length
        if not 0 < step <= len(objects) - place:
            return False
        place += step
    return True
