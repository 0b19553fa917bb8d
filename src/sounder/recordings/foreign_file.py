"""Access to a foreign HDF5 or MATLAB file by the names that a layout gives."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset, is_hdf5, open_hdf5, open_root
from erm.common.gate.matlab import read_matlab
from erm.common.gate.plain import PlainNumbers
from erm.common.printable import printable
from sounder.recordings.formats import touchstone_set
from sounder.recordings.formats.find import content_of
from sounder.recordings.layout import Reference
from sounder.recordings.recording import line_of_sight

CHUNK_CACHE = 64 * 2**20
"""Size of HDF5's cache of decompressed chunks, for each open file [byte]. Chosen to hold a chunk of many directions."""


@dataclass(frozen=True)
class ForeignFile:
    """Content of a file by name. In the methods, ``label`` is the key of the layout, for errors.

    Attributes
    ----------
    path : Path
    root : mapping
        HDF5 file, or the variables of an older MATLAB file.
    """

    path: Path
    root: Mapping[str, Any]

    def node(self, name: str) -> Any:
        """Dataset of a name; ``group/name`` in a group or in a MATLAB structure."""
        node = self.root.get(name.strip("/"))
        if not isinstance(node, (Dataset, np.ndarray, PlainNumbers)):
            raise DataError(f"{self.path}: no dataset {name}, which the layout names")
        return node

    def numbers(self, value: Any, label: str) -> NDArray[Any]:
        """Numbers that the layout gives or refers to, without axes of length 1."""
        if not isinstance(value, Reference):
            return np.asarray(value)
        name, found = self._resolve(value)
        if found.dtype.kind not in "biuf":
            raise DataError(f"{self.path}: {label}: {name} is {found.dtype}; expected real numbers")
        return found.squeeze()

    def text(self, reference: Reference, label: str) -> str:
        """Text that the layout refers to."""
        name, found = self._resolve(reference)
        if found.dtype == np.uint16 and self._matlab_class(reference) == "char":
            found = np.array("".join(map(chr, found.ravel())))
        if found.size != 1 or found.dtype.kind not in "OSU":
            raise DataError(f"{self.path}: {label}: {name} is {found.dtype} {found.shape}; expected one text")
        text = found.item()
        return printable(text.decode(errors="replace") if isinstance(text, bytes) else str(text))

    def _resolve(self, value: Reference) -> tuple[str, NDArray[Any]]:
        """Name of a reference, for errors, and its value."""
        if value.dataset is not None:
            node = self.node(value.dataset)
            if "MATLAB_empty" in getattr(node, "attrs", {}):  # the file holds the shape in place of the values
                raise DataError(f"{self.path}: {value.dataset} is empty; expected values")
            return value.dataset, np.asarray(node[()])
        attributes = getattr(self.root if value.of is None else self.node(value.of), "attrs", {})
        if value.attribute not in attributes:
            raise DataError(f"{self.path}: no attribute {value.attribute}, which the layout names")
        return str(value.attribute), np.asarray(attributes[value.attribute])

    def number(self, value: Any, label: str) -> float:
        """One finite number."""
        found = self.numbers(value, label)
        if found.size != 1 or not np.isfinite(found).all():
            raise DataError(f"{self.path}: {label} is {_short(found)}; expected one finite number")
        return float(found)

    def scale(self, value: Any, label: str) -> float:
        """One positive number."""
        found = self.number(value, label)
        if found <= 0:
            raise DataError(f"{self.path}: {label} is {found:g}; expected a positive number")
        return found

    def angles(self, value: Any, label: str) -> NDArray[np.float64]:
        """List of finite angles [degree]."""
        found = np.atleast_1d(self.numbers(value, label)).astype(float)
        if found.ndim != 1 or not found.size or not np.isfinite(found).all():
            raise DataError(f"{self.path}: {label} is {_short(found)}; expected a list of finite angles")
        return found

    def lines_of_sight(self, value: Any, positions: int, label: str) -> list[int]:
        """1, 0 or -1 for each position; see :class:`sounder.recordings.recording.Recording`."""
        found = self.numbers(value, label)
        if found.shape not in ((), (positions,)):
            raise DataError(f"{self.path}: {label} has shape {found.shape}; expected one number or {positions}")
        return [line_of_sight(los, self.path, label) for los in np.broadcast_to(found, positions).tolist()]

    def points(self, value: Any, positions: int, label: str) -> NDArray[np.float64]:
        """A point for each position (position, xyz) [m]. Points that are not finite are returned as they are."""
        found = self.numbers(value, label).astype(float)
        if found.shape == (1, 3):
            found = found[0]
        if found.shape == (3, positions) and (positions != 3 or self._transposed(value)):
            found = found.T
        if found.shape not in ((3,), (positions, 3)):
            raise DataError(f"{self.path}: {label} has shape {found.shape}; expected (3,) or ({positions}, 3) metres")
        return np.broadcast_to(found, (positions, 3))

    def _transposed(self, value: Any) -> bool:
        """Whether a dataset was saved by MATLAB 7.3, whose arrays HDF5 shows transposed."""
        return isinstance(value, Reference) and self._matlab_class(value) is not None

    def _matlab_class(self, value: Reference) -> Any:
        """Class that MATLAB 7.3 stored with a dataset; None for other values."""
        node = None if value.dataset is None else self.node(value.dataset)
        return node.attrs.text("MATLAB_class", "") or None if isinstance(node, Dataset) else None


@contextmanager
def foreign_file(path: Path, names: str | None = None) -> Iterator[ForeignFile]:
    """Open a file, or a folder of touchstone files with ``names``.

    Raises
    ------
    DataError
        There is no such file, or no reader knows its format.
    """
    if (content := _plain(path, names)) is not None:
        yield ForeignFile(path, content)
    else:
        with open_hdf5(path, "an HDF5 file, or one of another known format") as file:
            yield ForeignFile(path, file)


def _plain(path: Path, names: str | None) -> Mapping[str, Any] | None:
    """Content of what is no HDF5 file; None for what is one, or may be."""
    if names is not None and path.is_dir():
        return touchstone_set.content(path, names)
    if not path.is_file() or is_hdf5(path):
        return None
    return read_matlab(path) if path.suffix.lower() == ".mat" else content_of(path)


def opener(path: Path, names: str | None = None) -> Callable[[], ForeignFile]:
    """Function that returns the file, opened at its first call and then kept open for all positions.

    A chunk often holds many directions; the next call finds it in HDF5's cache.
    """

    @cache
    def file() -> ForeignFile:
        # closed with the last recording that reads from it
        content = _plain(path, names)
        return ForeignFile(path, open_root(path, rdcc_nbytes=CHUNK_CACHE) if content is None else content)

    return file


def _short(values: NDArray[Any]) -> str:
    return str(values.tolist()) if values.size < 5 else f"an array {values.shape}"
