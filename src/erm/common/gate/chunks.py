"""Chunks of HDF5 datasets: one that holds less than it should is refused before HDF5 unpacks it.

HDF5 takes what its filters leave of a chunk for a whole chunk, whatever its length is, and copies from there: memory of
others, or none. A chunk shorter than a checksum ends in a crash too. Therefore the stored length of each chunk is
compared with what its filters make of a whole one, and what gzip packed is unpacked once to learn its length. A chunk
that holds more is refused as well: it may take any memory.

References
----------
HDF5 File Format Specification Version 3.0, IV.A.2.l "The Data Storage - Filter Pipeline Message".
"""

import zlib
from collections.abc import Iterator
from itertools import product
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from erm.common.errors import DataError
from erm.common.gate.hdf5_rules import CHECKSUM, FLETCHER32, GZIP, LZF, PACKERS

if TYPE_CHECKING:
    import h5py


TEXT = 16
"""Length [byte] of what a dataset holds of a text of any length: its length, its heap, its number there."""


class Chunk(NamedTuple):
    """Place and length of a chunk in the file [byte], and the filters that were left out (one bit each)."""

    place: int
    length: int
    without: int


class Chunks:
    """Chunks that the file stores of a dataset.

    Attributes
    ----------
    stored : dict of Chunk
        By the index of the first element.

    Raises
    ------
    DataError
        A chunk is too short or too long.
    """

    def __init__(self, path: Path, name: str, node: "h5py.Dataset") -> None:
        self.path, self.name, self.node = path, name, node
        plist = node.id.get_create_plist()
        self._filters = [plist.get_filter(i) for i in range(plist.get_nfilters())]
        self._shape = plist.get_chunk()
        self._whole = prod(self._shape) * _stored_size(node.id.get_type())
        self.stored = dict(_listed(node.id))
        size = path.stat().st_size
        lengths = {without: self._lengths(without) for without in {chunk.without for chunk in self.stored.values()}}
        for index, chunk in self.stored.items():
            exact, after = lengths[chunk.without]
            if (chunk.length != exact) if exact is not None else not after < chunk.length <= size:
                wanted = exact or f"{after + 1} to {size}"
                raise self._damaged(index, f"stores {chunk.length} bytes; expected {wanted}")
        self._unpacked: set[tuple[int, ...]] = set()

    @property
    def unmodified(self) -> bool:
        """Whether the chunks hold the numbers as they are, and a checksum each."""
        return [code for code, *_ in self._filters] == [FLETCHER32] and not any(c.without for c in self.stored.values())

    def require(self, selection: Any) -> None:
        """Refuse chunks that integers and slices select, or all if there is anything else, if they do not fit."""
        if not any(code in PACKERS for code, *_ in self._filters):
            return
        for index in self._touched(selection):
            if index in self.stored and index not in self._unpacked:
                self._require_packed(index)
                self._unpacked.add(index)

    def _lengths(self, without: int) -> tuple[int | None, int]:
        """Length of a stored chunk, None if it is packed, and the length of the checksums behind what is packed."""
        exact: int | None = self._whole
        after = 0
        for place, (code, *_) in enumerate(self._filters):
            if without >> place & 1:
                continue
            if code in PACKERS:
                exact, after = None, 0
            elif code == FLETCHER32:
                exact, after = exact and exact + CHECKSUM, after + CHECKSUM
        return exact, after

    def _require_packed(self, index: tuple[int, ...]) -> None:
        """Refuse a packed chunk that is not as long as it should be when it is unpacked."""
        chunk = self.stored[index]
        place = next(i for i, (code, *_) in enumerate(self._filters) if code in PACKERS)
        if chunk.without >> place & 1:
            return
        earlier = (code for i, (code, *_) in enumerate(self._filters[:place]) if not chunk.without >> i & 1)
        whole = self._whole + CHECKSUM * sum(code == FLETCHER32 for code in earlier)
        code, _, values, _ = self._filters[place]
        if code == LZF:  # HDF5 takes memory for as much as the filter was told
            found = values[2] if len(values) > 2 else 0
        else:
            packed = self.node.id.read_direct_chunk(index)[1]
            packed = packed[: len(packed) - self._lengths(chunk.without)[1]]
            if code == GZIP:
                try:
                    found = len(zlib.decompressobj().decompress(packed, whole + 1))
                except zlib.error:
                    raise self._damaged(index, "cannot be unpacked") from None
            else:  # szip writes how much memory it takes
                found = int.from_bytes(packed[:4], "little")
        if found != whole:
            raise self._damaged(index, f"unpacks to {found} bytes; expected {whole}")

    def _touched(self, selection: Any) -> Iterator[tuple[int, ...]]:
        """First elements of the chunks that integers and slices may select."""
        parts = selection if isinstance(selection, tuple) else (selection,)
        shape = self.node.shape
        if len(parts) > len(shape) or not all(isinstance(part, slice) or hasattr(part, "__index__") for part in parts):
            parts = ()
        parts += (slice(None),) * (len(shape) - len(parts))
        spans = []
        for part, length, chunk in zip(parts, shape, self._shape, strict=True):
            wanted = range(length)[part]
            wanted = wanted if isinstance(wanted, range) else range(wanted, wanted + 1)
            low, high = (min(wanted[0], wanted[-1]), max(wanted[0], wanted[-1]) + 1) if wanted else (0, 0)
            spans.append(range(low // chunk * chunk, high, chunk))
        return product(*spans)

    def _damaged(self, index: tuple[int, ...], what: str) -> DataError:
        place = ", ".join(map(str, index))
        return DataError(
            f"{self.path}: damaged HDF5 file ({self.name}: the chunk at {place} {what}); make or copy it again"
        )


def _stored_size(kind: "h5py.h5t.TypeID") -> int:
    """Length of an element in the file [byte]. HDF5 tells that in memory, where a text is longer or shorter."""
    from h5py import h5t

    code = kind.get_class()
    if code == h5t.VLEN or (isinstance(kind, h5t.TypeStringID) and kind.is_variable_str()):
        return TEXT
    if isinstance(kind, h5t.TypeArrayID):
        return prod(kind.get_array_dims()) * _stored_size(kind.get_super())
    if isinstance(kind, h5t.TypeCompoundID):
        members = [kind.get_member_type(number) for number in range(kind.get_nmembers())]
        return int(kind.get_size()) + sum(_stored_size(member) - int(member.get_size()) for member in members)
    return int(kind.get_size())


def _listed(dataset: Any) -> Iterator[tuple[tuple[int, ...], Chunk]]:
    """Each chunk that is stored, by the index of its first element."""
    found: list[Any] = []
    if hasattr(dataset, "chunk_iter"):
        dataset.chunk_iter(found.append)
    else:  # h5py was built with an older HDF5
        found = [dataset.get_chunk_info(number) for number in range(dataset.get_num_chunks())]
    for info in found:
        yield tuple(info.chunk_offset), Chunk(info.byte_offset, info.size, info.filter_mask)
