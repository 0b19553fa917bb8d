"""Rules for the links, the filters and the sizes in HDF5 files."""

from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError
from erm.common.gate import limits
from erm.common.printable import printable

if TYPE_CHECKING:
    import h5py

GZIP, SHUFFLE, FLETCHER32, SZIP, LZF = FILTERS = (1, 2, 3, 4, 32000)
"""Numbers of the filters that are applied: those that come with h5py and whose output has a length that is known."""
PACKERS = {GZIP, SZIP, LZF}
CHECKSUM = 4
"""Bytes that fletcher32 adds to each chunk."""
MAX_EXPANSION = 1032
"""Largest ratio of gzip: two bits for the longest match, 258 bytes (zlib, "Technical Details")."""
SMALL = 2**26
"""Size below which a dataset may be empty space for the most part [byte]; chosen, a fraction of what Python takes."""
MAX_AXES = 16
"""Most axes of a dataset; chosen, twice the axes of a layout."""
COPY = "copy the data into one file (h5repack), or ask for a file that holds them"


def require_hard(path: Path, group: "h5py.Group", name: str) -> None:
    """Refuse a link to another place."""
    import h5py

    info = group.id.links.get_info(name.encode())
    if info.type == h5py.h5l.TYPE_HARD:
        return
    target = "another place"
    if info.type == h5py.h5l.TYPE_EXTERNAL:
        file, item = group.id.links.get_val(name.encode())
        target = f"{item.decode(errors='replace')} of the file {file.decode(errors='replace')}"
    elif info.type == h5py.h5l.TYPE_SOFT:
        target = group.id.links.get_val(name.encode()).decode(errors="replace")
    raise DataError(f"{path}: {printable(name)} is a link to {printable(target)}, which is not followed; {COPY}")


def require_filters(path: Path, name: str, plist: Any) -> None:
    """Refuse filters that need a plugin, and two that pack one after another: they multiply the expansion."""
    filters = [plist.get_filter(index) for index in range(plist.get_nfilters())]
    numbers = [code for code, *_ in filters]
    for code, _, _, label in filters:
        if code not in FILTERS:
            given = printable(label.decode(errors="replace")) or "no name"
            raise DataError(
                f"{path}: {name} is packed by the filter {code} ({given}), and plugins are not loaded; repack it with "
                "h5repack -f GZIP=4"
            )
    if len(set(numbers)) < len(numbers) or len(PACKERS & set(numbers)) > 1:
        raise DataError(f"{path}: {name} is packed twice; repack it with h5repack -f GZIP=4")


def require_space(path: Path, name: str, node: "h5py.Dataset", plist: Any) -> None:
    """Compare what a dataset declares with what the file stores of it, and its chunks with the limit of memory."""
    import h5py

    shape, item = node.shape or (), node.id.get_type().get_size()
    if len(shape) > MAX_AXES:
        raise DataError(f"{path}: {name} has {len(shape)} axes; expected at most {MAX_AXES}")
    layout = plist.get_layout()
    if layout == h5py.h5d.CHUNKED and (chunk := prod(plist.get_chunk()) * item) > limits.current().max_bytes:
        raise DataError(f"{path}: a chunk of {name} {limits.too_large(chunk)}")
    declared = prod(shape) * item
    if declared > SMALL and layout != h5py.h5d.VIRTUAL:
        stored = int(node.id.get_storage_size())
        if declared > MAX_EXPANSION * stored:
            raise DataError(
                f"{path}: {name} declares {limits.size(declared)}, but the file stores {limits.size(stored)} of it; "
                "record or export it again"
            )


def selected(shape: tuple[int, ...], selection: Any) -> int:
    """Number of elements that integers and slices select; other selections count as all."""
    parts = selection if isinstance(selection, tuple) else (selection,)
    if len(parts) > len(shape) or not all(isinstance(part, slice) or hasattr(part, "__index__") for part in parts):
        return prod(shape)
    chosen = [
        len(range(*part.indices(n))) if isinstance(part, slice) else 1 for part, n in zip(parts, shape, strict=False)
    ]
    return prod(chosen) * prod(shape[len(parts) :])
