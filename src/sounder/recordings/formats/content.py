"""What a file of samples holds: arrays and attributes by name, as a layout refers to them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Content(Mapping[str, Any]):
    """Arrays and attributes of a file.

    Attributes
    ----------
    kind : str
        Name of the format.
    arrays : mapping
        `erm.common.gate.plain.PlainNumbers` or numpy arrays by name.
    attrs : mapping
        Numbers and texts by name.
    files : tuple of Path
        Further files that it was read from.
    """

    kind: str
    arrays: Mapping[str, Any]
    attrs: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    def __getitem__(self, name: str) -> Any:
        """Array of a name."""
        return self.arrays[name]

    def __iter__(self) -> Iterator[str]:
        """Names of the arrays."""
        return iter(self.arrays)

    def __len__(self) -> int:
        """Number of arrays."""
        return len(self.arrays)
