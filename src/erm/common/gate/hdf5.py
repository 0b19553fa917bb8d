"""HDF5 files of anybody: what is opened, and what is refused.

HDF5 lets a file pull in others: by links, by external storage, by virtual datasets and by plugins of filters. A file of
another group could so read any file of the user and have it copied into a product. Therefore only hard links inside the
file are followed, data are taken from the file itself, and filters are those of `hdf5_rules.FILTERS`. Nothing is
allocated before its size was compared with the limits and with what the file really stores.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError
from erm.common.gate import limits
from erm.common.gate.attributes import Attributes
from erm.common.gate.chunks import Chunks
from erm.common.gate.damage import refused
from erm.common.gate.files import require_file
from erm.common.gate.hdf5_rules import COPY, require_filters, require_hard, require_space, selected
from erm.common.gate.heaps import require_heaps, require_lengths
from erm.common.printable import printable

if TYPE_CHECKING:
    import h5py
    import numpy as np

MAX_MEMBERS = 10_000
"""Most members of a group that are listed; chosen. A member that is named is found among any number."""


@contextmanager
def open_hdf5(path: Path, expected: str = "a file of this software", **options: Any) -> Iterator["Group"]:
    """Open an HDF5 file for reading.

    Parameters
    ----------
    path : path
        The file.
    expected : str
        What the file should be, for errors.
    **options
        Of ``h5py.File``.

    Raises
    ------
    DataError
        The file is missing, is not HDF5, is damaged, is locked, or asks for what the gate refuses.
    """
    with open_root(path, expected, **options) as root:
        yield root


def open_root(path: Path, expected: str = "a file of this software", **options: Any) -> "Root":
    """Open an HDF5 file; the caller closes it."""
    import h5py  # slow to import; --help must stay fast

    require_file(path)
    if not is_hdf5(path):
        raise DataError(f"{path}: not an HDF5 file; expected {expected}")
    require_heaps(path)
    with refused(path):
        return Root(path, h5py.File(path, "r", **options))


def is_hdf5(path: Path) -> bool:
    """Whether a regular file begins as HDF5 does."""
    import h5py

    return path.is_file() and bool(h5py.is_hdf5(path))


class Dataset:
    """A dataset whose data are in its own file."""

    def __init__(self, path: Path, node: "h5py.Dataset") -> None:
        self.path, self.node, self.name = path, node, (node.name or "?").strip("/")
        with refused(path, f"{self.name}: "):
            plist = node.id.get_create_plist()
            _require_own_data(path, self.name, plist)
            self.shape: tuple[int, ...] = () if node.shape is None else tuple(node.shape)
            self.empty = node.shape is None
            self.dtype: np.dtype[Any] = node.dtype
            self.item = int(node.id.get_type().get_size())
            require_filters(path, self.name, plist)
            require_space(path, self.name, node, plist)
        self.attrs = Attributes(path, node)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of elements."""
        return 0 if self.empty else prod(self.shape)

    @property
    def checksummed(self) -> bool:
        """Whether HDF5 verifies what is read; where no numbers are stored, nothing is to be verified."""
        with refused(self.path, f"{self.name}: "):
            stored = self.dtype.kind != "O" and self.node.id.get_storage_size()
            return bool(self.node.fletcher32) or not stored

    @property
    def chunks(self) -> "dict[tuple[int, ...], tuple[int, int]] | None":
        """Place and length in the file of each chunk by its first index; None if they are not there as numbers."""
        if not self.dtype.isnative or (chunks := self._chunks) is None or not chunks.unmodified:
            return None
        return {index: (chunk.place, chunk.length) for index, chunk in chunks.stored.items()}

    @cached_property
    def _chunks(self) -> Chunks | None:
        """Chunks that are stored, none shorter or longer than it should be; None for other layouts."""
        import h5py

        with refused(self.path, f"{self.name}: "):
            chunked = self.node.id.get_create_plist().get_layout() == h5py.h5d.CHUNKED
            return Chunks(self.path, self.name, self.node) if chunked else None

    def require_chunks(self, selection: Any = ()) -> None:
        """Refuse what HDF5 would read with too little behind it."""
        with refused(self.path, f"{self.name}: "):
            if (chunks := self._chunks) is not None:
                chunks.require(selection)
            require_lengths(self.path, self.name, self.node)

    @cached_property
    def is_scale(self) -> bool:
        """Whether it holds the values of an axis.

        HDF5's own function frees memory twice if the text that tells is damaged in some ways.
        """
        kind = self.attrs.get("CLASS")
        return isinstance(kind, str) and kind == "DIMENSION_SCALE"

    @property
    def offset(self) -> int | None:
        """Place of data that the file stores in one piece, as this machine holds them in memory; otherwise None."""
        with refused(self.path, f"{self.name}: "):
            plain = self.node.chunks is None and not self.node.is_virtual and self.dtype.isnative
            offset = self.node.id.get_offset() if plain else None
            return None if offset is None else int(offset)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, selection: Any) -> Any:
        """Values; numbers as arrays, texts as ``bytes``."""
        length = self.item * selected(self.shape, selection)
        if length > limits.current().max_bytes:
            raise DataError(f"{self.path}: {self.name} {limits.too_large(length)}")
        if self.empty:
            raise DataError(f"{self.path}: {self.name} holds nothing")
        self.require_chunks(selection)
        with refused(self.path, f"{self.name}: "):
            return self.node[selection]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> "np.ndarray":
        """All values, so that numpy takes a dataset for an array."""
        import numpy as np

        return np.asarray(self[()], dtype=dtype)

    def numbers(self) -> "np.ndarray":
        """All values as real numbers.

        Raises
        ------
        DataError
            They are no real numbers.
        """
        import numpy as np

        if self.dtype.kind not in "biuf" or self.dtype.subdtype is not None:
            raise DataError(f"{self.path}: {self.name} is {self.dtype}; expected real numbers")
        return np.asarray(self[()])

    def texts(self) -> list[str]:
        """All values as texts that can be shown.

        Raises
        ------
        DataError
            They are no texts.
        """
        import numpy as np

        if self.dtype.kind not in "SO":
            raise DataError(f"{self.path}: {self.name} is {self.dtype}; expected texts")
        values = np.atleast_1d(self[()]).ravel().tolist()
        return [printable(each.decode("utf-8", "replace") if isinstance(each, bytes) else str(each)) for each in values]


class Group(Mapping[str, Any]):
    """A group. Members are reached through hard links only, and checked once while the file is open."""

    def __init__(self, path: Path, node: "h5py.Group") -> None:
        self.path, self.node = path, node
        self.attrs = Attributes(path, node)
        self._checked: dict[str, Any] = {}

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._linked(name) is not None

    def __getitem__(self, name: str) -> Any:
        if name not in self._checked:
            top, _, rest = name.strip("/").partition("/")
            held = self[top] if rest else None
            self._checked[name] = held[rest] if isinstance(held, Group) else self._member(name)
        return self._checked[name]

    def _member(self, name: str) -> Any:
        import h5py

        found = self._linked(name)
        if found is None:
            raise KeyError(name)
        parent, leaf = found
        with refused(self.path, f"{name}: "):
            kind = h5py.h5o.get_info(parent.id, leaf.encode()).type
            if kind == h5py.h5o.TYPE_GROUP:
                return Group(self.path, parent[leaf])
            if kind == h5py.h5o.TYPE_DATASET:
                return Dataset(self.path, _dataset(self.path, parent, leaf))
        raise DataError(f"{self.path}: {printable(name)} is a type; expected a dataset")

    def __iter__(self) -> Iterator[str]:
        if (count := len(self)) > MAX_MEMBERS:
            raise DataError(f"{self.path}: {self.node.name} has {count} members; expected at most {MAX_MEMBERS}")
        with refused(self.path):
            names = list(self.node)
        return iter(names)

    def __len__(self) -> int:
        with refused(self.path):
            return len(self.node)

    def dataset(self, name: str) -> Dataset:
        """Return a dataset of a name, or refuse the file."""
        found = self.get(name)
        if not isinstance(found, Dataset):
            raise DataError(
                f"{self.path}: {'no' if found is None else 'a group in place of the'} dataset {printable(name)}"
            )
        return found

    def group(self, name: str) -> "Group":
        """Return a group of a name, or refuse the file."""
        found = self.get(name)
        if not isinstance(found, Group):
            raise DataError(
                f"{self.path}: {'no' if found is None else 'a dataset in place of the'} group {printable(name)}"
            )
        return found

    def _linked(self, name: str) -> "tuple[h5py.Group, str] | None":
        """Group that holds the last link of a path, and the name of the link; None where there is none."""
        import h5py

        node = self.node
        parts = [part for part in name.split("/") if part]
        for depth, part in enumerate(parts):
            with refused(self.path, f"{printable(name)}: "):
                if not isinstance(node, h5py.Group) or not node.id.links.exists(part.encode()):
                    return None
                require_hard(self.path, node, part)
                if depth == len(parts) - 1:
                    return node, part
                if h5py.h5o.get_info(node.id, part.encode()).type != h5py.h5o.TYPE_GROUP:
                    return None
                node = node[part]
        return None


class Root(Group):
    """Root group of an open file."""

    def __enter__(self) -> "Root":
        return self

    def __exit__(self, *_: object) -> None:
        self.node.close()


def _require_own_data(path: Path, name: str, plist: Any) -> None:
    """Refuse external storage; refuse virtual datasets unless they are asked for."""
    import h5py

    if plist.get_external_count():
        source = plist.get_external(0)[0].decode(errors="replace")
        raise DataError(f"{path}: {name} is stored outside, in {printable(source)}, which is not read; {COPY}")
    if plist.get_layout() != h5py.h5d.VIRTUAL:
        return
    count = plist.get_virtual_count()
    sources = sorted({plist.get_virtual_filename(i) for i in range(min(count, MAX_MEMBERS))})
    if not limits.current().virtual:
        for file in sources:
            _require_beside(path, name, file)
        first = printable(sources[0]) if sources else "no file"
        raise DataError(
            f"{path}: {name} is a virtual dataset, whose data are in {first}; if you trust it, allow it with --virtual "
            "before the command"
        )
    if count > MAX_MEMBERS:
        raise DataError(f"{path}: {name} has {count} parts; expected at most {MAX_MEMBERS}")
    for index in range(count):
        _require_source(path, name, plist.get_virtual_filename(index), plist.get_virtual_dsetname(index))


def _require_beside(path: Path, name: str, file: str) -> Path:
    """Source of a virtual dataset; refused where it is not in the folder of the file or below, or is missing."""
    folder = path.resolve().parent
    source = path if file == "." else folder / file
    inside = not Path(file).is_absolute() and source.resolve().is_relative_to(folder)
    if not inside or "%" in file:
        raise DataError(
            f"{path}: {name} is a virtual dataset, whose data are in {printable(file)}; only files in the folder of "
            f"{path.name} or below are read"
        )
    if not source.is_file():
        raise DataError(
            f"{path}: {name} is a virtual dataset, and its source {printable(file)} is missing; copy it too"
        )
    return source


def _require_source(path: Path, name: str, file: str, dataset: str) -> None:
    """Refuse a source of a virtual dataset that is not beside it, or has its own data elsewhere."""
    import h5py

    source = _require_beside(path, name, file)
    if "%" in dataset:
        raise DataError(f"{path}: {name} is a virtual dataset of numbered datasets, {printable(dataset)}; {COPY}")
    with open_hdf5(source) as root:
        held = root.get(dataset)
        if not isinstance(held, Dataset):
            raise DataError(f"{path}: {name} is a virtual dataset, but {file} has no dataset {printable(dataset)}")
        if held.node.id.get_create_plist().get_layout() == h5py.h5d.VIRTUAL:
            raise DataError(f"{path}: {name} is a virtual dataset of a virtual dataset, {printable(dataset)}; {COPY}")
        held.require_chunks()


def _dataset(path: Path, parent: "h5py.Group", name: str) -> "h5py.Dataset":
    """Open a dataset; sources of a virtual one are looked up in its folder."""
    import h5py

    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_virtual_prefix(bytes(path.resolve().parent))
    return h5py.Dataset(h5py.h5d.open(parent.id, name.encode(), access))
