"""Samples read straight from a native recording, without opening it by HDF5 for each direction.

No memory map: a file that is cut while it is mapped kills the process.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset
from erm.common.gate.limits import current, too_large
from sounder.recordings.checksum import BYTES, checksum_holds
from sounder.recordings.recording import Captures


def reader(path: Path, iq: Dataset) -> Callable[[int, int, slice], Captures] | None:
    """Reader of the captures of one direction; None if the file packs ``iq`` or stores it in other pieces.

    Parameters
    ----------
    path : Path
    iq : Dataset
        int16 (azimuth, elevation, snapshot, sample, 2).

    Raises
    ------
    DataError
        The file ends before the last sample.
    """
    shape = iq.shape
    size = path.stat().st_size
    if iq.offset is not None:
        if size < iq.offset + iq.size * iq.item:
            raise DataError(f"{path}: the file ends before its last sample; copy it again")
        return _contiguous(path, iq.offset, shape)
    places = iq.chunks
    length = None if places is None else iq.node.chunks
    if places is None or length is None or length[:2] != (1, 1) or length[3:] != shape[3:]:
        return None
    if places and size < max(offset + count for offset, count in places.values()):
        raise DataError(f"{path}: the file ends before its last sample; copy it again")
    return _chunked(path, places, length[2], shape)


def _contiguous(path: Path, offset: int, shape: tuple[int, ...]) -> Callable[[int, int, slice], Captures]:
    capture = 2 * shape[3] * shape[4]

    def read(a: int, e: int, snapshots: slice) -> Captures:
        first, count, step = _range(path, snapshots, shape)
        start = offset + ((a * shape[1] + e) * shape[2] + first) * capture
        data = _bytes(path, [(start, count * capture)])[0]
        return np.frombuffer(data, np.int16).reshape(count, *shape[3:])[::step]

    return read


def _chunked(
    path: Path, places: dict[tuple[int, ...], tuple[int, int]], length: int, shape: tuple[int, ...]
) -> Callable[[int, int, slice], Captures]:
    """Reader of chunks of ``length`` snapshots with checksums; chunks that were not written are zero."""

    def read(a: int, e: int, snapshots: slice) -> Captures:
        first, count, step = _range(path, snapshots, shape)
        if not count:
            return np.empty((0, *shape[3:]), np.int16)
        begin = first // length * length
        wanted = [(s, places.get((a, e, s, 0, 0))) for s in range(begin, first + count, length)]
        data = iter(_bytes(path, [place for _, place in wanted if place is not None]))
        pieces = []
        for s, place in wanted:
            if place is None:
                pieces.append(np.zeros((length, *shape[3:]), np.int16))
                continue
            chunk = next(data)
            if not checksum_holds(chunk):
                raise DataError(
                    f"{path}: damaged HDF5 file (iq: the checksum of direction {a}, {e} from snapshot {s} does not "
                    "hold); copy it again"
                )
            pieces.append(np.frombuffer(chunk, np.int16, count=(len(chunk) - BYTES) // 2).reshape(-1, *shape[3:]))
        joined = pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
        return joined[first - begin : first - begin + count][::step]

    return read


def _range(path: Path, snapshots: slice, shape: tuple[int, ...]) -> tuple[int, int, int]:
    """First snapshot, number of snapshots to be read from there, and step."""
    wanted = range(*snapshots.indices(shape[2]))
    if not wanted:
        return 0, 0, 1
    first, last = min(wanted[0], wanted[-1]), max(wanted[0], wanted[-1])
    count = last - first + 1
    if (size := count * 2 * shape[3] * shape[4]) > current().max_bytes:
        raise DataError(f"{path}: a direction of iq {too_large(size)}")
    return first, count, wanted.step


def _bytes(path: Path, places: list[tuple[int, int]]) -> list[bytes]:
    """Bytes of places (offset, length) in a file."""
    try:
        with open(path, "rb", buffering=0) as file:
            found = []
            for offset, length in places:
                file.seek(offset)
                found.append(file.read(length))
    except OSError as error:
        raise DataError(f"{path}: iq cannot be read ({error.strerror}); copy the file again") from None
    if any(len(data) < length for data, (_, length) in zip(found, places, strict=True)):
        raise DataError(f"{path}: became shorter while it was read; copy it again")
    return found
