"""Global heaps of HDF5 files, which hold texts: HDF5 never ends reading one whose list of objects goes in a circle.

A heap is ``GCOL``, version 1, its length, and objects one after another: an index (2 bytes), 6 bytes, the length of the
content (8 bytes), the content padded to 8 bytes. Index 0 is the free rest; its length counts its header. Zeros in the
place of this header say that the next object is where this one is.

Heaps lie between the samples, never in them. What a large file holds of samples is therefore not searched: opening a
recording of gigabytes reads none of it.

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
from erm.common.gate.nesting import MAX_DEPTH

BEGINNING = b"GCOL\1\0\0\0"
OBJECT = struct.Struct("<H6xQ")
BLOCK = 2**20
"""Piece of a file that is searched at once, and least stored data that are left out [byte]; chosen."""


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
        begin = 0
        for first, length in [*_large_data(path, size), (size, 0)]:
            for place in _heaps(file, begin, first):
                file.seek(place + len(BEGINNING))
                claimed = int.from_bytes(file.read(8), "little")
                if claimed <= size - place and not _ends(file.read(claimed - OBJECT.size)):
                    return place
            begin = max(begin, first + length)
    return None


def _large_data(path: str, size: int) -> list[tuple[int, int]]:
    """Place and length in the file of what large datasets store, in order; none if the file's structure is damaged."""
    if size < 2 * BLOCK:
        return []
    import h5py

    found: list[tuple[int, int]] = []

    def note(name: bytes) -> bool | None:
        if name.count(b"/") > MAX_DEPTH:
            return True  # ends here: what is not known to be data is searched
        node = h5py.h5o.open(file.id, name)
        if not isinstance(node, h5py.h5d.DatasetID):
            return None
        plist = node.get_create_plist()
        if plist.get_layout() not in (h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED) or plist.get_external_count():
            return None
        if node.get_storage_size() < BLOCK:
            return None
        if (offset := node.get_offset()) is not None:
            found.append((offset, node.get_storage_size()))
        elif hasattr(node, "chunk_iter"):  # absent where h5py was built with an older HDF5
            node.chunk_iter(lambda chunk: found.append((chunk.byte_offset, chunk.size)))
        return None

    try:
        with h5py.File(path, "r") as file:
            h5py.h5o.visit(file.id, note)
    except (OSError, RuntimeError, ValueError, KeyError):
        return []  # opening the file says why
    return sorted(found)


def _heaps(file: BinaryIO, begin: int, end: int) -> Iterator[int]:
    """Places of all heaps that begin from `begin` up to `end`."""
    while begin < end and file.seek(begin) == begin:
        block = file.read(min(BLOCK, end - begin) + len(BEGINNING) - 1)
        at = block.find(BEGINNING)
        while at >= 0:
            yield begin + at
            at = block.find(BEGINNING, at + 1)
        begin += BLOCK


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
