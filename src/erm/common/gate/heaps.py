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
from typing import TYPE_CHECKING, BinaryIO

from erm.common.errors import DataError
from erm.common.gate.chunks import TEXT
from erm.common.gate.nesting import MAX_DEPTH

if TYPE_CHECKING:
    import h5py

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
                if claimed < OBJECT.size or (claimed <= size - place and not _ends(file.read(claimed - OBJECT.size))):
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


def require_lengths(path: Path, name: str, node: "h5py.Dataset") -> None:
    """Refuse texts that are said to be longer than their file: HDF5 takes the memory before it looks for them.

    Raises
    ------
    DataError
        There is such a text.
    """
    import h5py
    import numpy as np

    text, plist = h5py.check_string_dtype(node.dtype), node.id.get_create_plist()
    if text is None or text.length is not None or plist.get_nfilters():
        return
    pieces = [(node.id.get_offset(), node.id.get_storage_size())]
    if plist.get_layout() == h5py.h5d.CHUNKED:
        infos = [node.id.get_chunk_info(number) for number in range(node.id.get_num_chunks())]
        pieces = [(info.byte_offset, info.size) for info in infos]
    size = path.stat().st_size
    with open(path, "rb") as file:
        for place, length in pieces:
            if place is None:
                continue
            file.seek(place)
            stored = np.frombuffer(file.read(min(length, size) // TEXT * TEXT), "<u4")
            if (longest := int(stored[:: TEXT // stored.itemsize].max(initial=0))) > size:  # the length comes first
                raise DataError(f"{path}: damaged HDF5 file ({name}: a text of {longest} bytes); make or copy it again")


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
