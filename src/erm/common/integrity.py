"""Checksums of datasets, and the list of what a file holds.

Each dataset has the filter fletcher32 of HDF5: a checksum of every chunk. HDF5 verifies it when it reads the chunk, and
makes it anew when other software changes the data on purpose. It finds every changed bit, and every burst of errors up
to 16 bits long. The root attribute ``members`` names each member with its type and shape, so that a lost or exchanged
one is missed.

References
----------
J. G. Fletcher, "An arithmetic checksum for serial transmissions," IEEE Transactions on
Communications 30 (1982) 247-252.
"""

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset, Group
from erm.common.gate.nesting import parse_json
from erm.common.printable import printable

if TYPE_CHECKING:
    import h5py

MEMBERS, GROUP = "members", "group"
CHUNK = 2**20
"""Largest chunk [byte], unless one row is larger; HDF5 keeps chunks of this size while it reads parts of them."""


def checksummed(shape: tuple[int, ...], item: int) -> dict[str, Any]:
    """Options of ``create_dataset`` for a dataset with checksums; none where HDF5 has no chunks.

    Examples
    --------
    >>> checksummed((72, 3), 8)
    {'chunks': (72, 3), 'fletcher32': True}
    >>> checksummed((), 8), checksummed((0, 3), 8)
    ({}, {})
    """
    if not shape or 0 in shape:
        return {}
    row = item
    for length in shape[1:]:
        row *= length
    return {"chunks": (max(1, min(shape[0], CHUNK // row)), *shape[1:]), "fletcher32": True}


def list_members(file: "h5py.File") -> None:
    """Store the names, types and shapes of all members in the file."""
    import h5py

    found: dict[str, str] = {}

    def note(name: str, node: Any) -> None:
        found[name] = _type(node) if isinstance(node, h5py.Dataset) else GROUP

    file.visititems(note)
    file.attrs[MEMBERS] = json.dumps(found, sort_keys=True)


def require_members(file: Group, within: str = "") -> None:
    """Refuse a file that has lost a member, or in which one has another type or shape.

    Parameters
    ----------
    file : Group
        Root group.
    within : str
        Group whose members are required, without those of its groups.
    """
    for name, kind in _listed(file):
        if name.rpartition("/")[0] == within.strip("/"):
            _require_member(file, name, kind)


def _listed(file: Group) -> list[tuple[str, str]]:
    """Names, types and shapes of the members that the file should have; none if it has no list."""
    if MEMBERS not in file.attrs:
        return []
    try:
        return [(str(name), str(kind)) for name, kind in parse_json(file.attrs.text(MEMBERS)).items()]
    except (ValueError, AttributeError):
        raise DataError(f"{file.path}: damaged: the list of its members is not readable; copy the file again") from None


def _require_member(file: Group, name: str, kind: str) -> None:
    held = file.get(name)
    if held is None:
        raise DataError(f"{file.path}: damaged: {printable(name)} is missing; copy the file again")
    found = _type(held.node) if isinstance(held, Dataset) else GROUP
    if found != kind and found.partition(" ")[0] != kind:  # earlier lists have no shapes
        raise DataError(f"{file.path}: damaged: {printable(name)} is {found}, written as {kind}; copy the file again")


def _type(node: "h5py.Dataset") -> str:
    import h5py

    dtype = node.dtype
    text = h5py.check_string_dtype(dtype) is not None
    kind = "text" if text else "complex" if dtype.names else dtype.str
    return f"{kind} {node.shape}".replace(", ", ",")


RIGHT, UNPROTECTED = GOOD = "right", "readable; has no checksum"
"""States of members with which nothing is wrong."""


def check_members(file: Group) -> Iterator[tuple[str, str]]:
    """Read everything that a file should hold; yield each member with one of `GOOD`, or with what is wrong with it."""
    listed = _listed(file) or [(name, "") for name in file]
    for name, kind in listed:
        try:
            if kind:
                _require_member(file, name, kind)
            member = file[name]
            if isinstance(member, Dataset):
                _read_through(member)
        except DataError as error:
            yield name, str(error).removeprefix(f"{file.path}: ")
        else:
            protected = not isinstance(member, Dataset) or member.checksummed
            yield name, RIGHT if protected else UNPROTECTED


def _read_through(dataset: Dataset) -> None:
    """Read all chunks, a few rows at a time."""
    if not dataset.ndim:
        dataset[()]
        return
    rows = max(1, CHUNK // max(dataset.item * dataset.size // max(len(dataset), 1), 1))
    for first in range(0, len(dataset), rows):
        dataset[first : first + rows]
