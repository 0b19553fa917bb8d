"""Attributes of HDF5 objects, as any language writes them."""

from collections.abc import Iterator, Mapping
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError
from erm.common.gate import limits
from erm.common.gate.damage import refused
from erm.common.gate.limits import MAX_TEXT
from erm.common.printable import printable

if TYPE_CHECKING:
    from h5py.h5a import AttrID

MAX_ATTRIBUTES = 1000
"""Most attributes of a member that are listed; chosen. One that is named is found among any number."""


class Attributes(Mapping[str, Any]):
    """Attributes of a node. A text is ``str``; what is no text or number, or is too large, is refused."""

    def __init__(self, path: Path, node: Any) -> None:
        self._path, self._node = path, node.attrs
        self._read: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        from h5py import h5t

        if name not in self._read:
            if name not in self:
                raise KeyError(name)
            with refused(self._path, f"attribute {name}: "):
                if self.sized(name).get_type().get_class() == h5t.VLEN:
                    # a text has a class of its own; HDF5 may crash on damaged lists
                    raise DataError(f"{self._path}: attribute {name} is a list; expected a text or numbers")
                self._read[name] = _decoded(self._node[name])
        return self._read[name]

    def sized(self, name: str) -> "AttrID":
        """Attribute of HDF5, which is refused where it is too large to be read."""
        attribute = self._node.get_id(name)
        length = prod(attribute.shape) * attribute.get_type().get_size()
        if length > MAX_TEXT:
            raise DataError(f"{self._path}: attribute {name} has {limits.size(length)}; expected less")
        return attribute

    def __contains__(self, name: object) -> bool:
        with refused(self._path, "attributes: "):
            return isinstance(name, str) and name in self._node

    def __iter__(self) -> Iterator[str]:
        if (count := len(self)) > MAX_ATTRIBUTES:  # HDF5 compares a name with all others
            raise DataError(f"{self._path}: {count} attributes of one member; expected at most {MAX_ATTRIBUTES}")
        with refused(self._path, "attributes: "):
            names = list(self._node)
        return iter(names)

    def __len__(self) -> int:
        with refused(self._path, "attributes: "):
            return len(self._node)

    def text(self, name: str, default: str | None = None) -> str:
        """Value of one text, as any language writes it, without control characters.

        Raises
        ------
        DataError
            There is none and no default, or it is no text.
        """
        value = self._single(name, default)
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if not isinstance(value, str):
            raise DataError(f"{self._path}: attribute {name} is {_short(value)}; expected a text")
        return value

    def label(self, name: str, default: str) -> str:
        """Text that is shown: control characters are escaped."""
        return printable(self.text(name, default))

    def number(self, name: str, default: float | None = None) -> float:
        """Value of one real number.

        Raises
        ------
        DataError
            There is none and no default, or it is no number.
        """
        value = self._single(name, default)
        try:
            if isinstance(value, (str, bytes)):
                raise TypeError
            return float(value)
        except (TypeError, ValueError, OverflowError):
            raise DataError(f"{self._path}: attribute {name} is {_short(value)}; expected a number") from None

    def _single(self, name: str, default: Any) -> Any:
        """Only element of an attribute; the default where it is absent or holds nothing."""
        import numpy as np

        value = self.get(name)
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.reshape(-1)[0]
        if value is None:
            if default is None:
                raise DataError(f"{self._path}: has no attribute {name}")
            return default
        return value


def _decoded(value: Any) -> Any:
    """Attribute without the types of HDF5: nothing is None, a text is ``str``."""
    import h5py

    if isinstance(value, h5py.Empty):
        return None
    if isinstance(value, str):
        value = value.encode("utf-8", "surrogateescape")  # as it stands in the file
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _short(value: object) -> str:
    text = repr(value)
    return printable(text if len(text) <= 60 else f"{text[:60]}...")
