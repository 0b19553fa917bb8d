"""Plain samples that a sidecar describes, as digitisers and software radios write them (``.bin``, ``.dat``, ``.iqw``).

Plain samples do not tell what they are. A TOML file beside them does, with their name and ``.toml`` behind it.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from erm.common.errors import DataError
from erm.common.gate.plain import PlainNumbers
from sounder.recordings.formats.content import Content
from sounder.toml import Table, read_toml


class Sidecar(Table):
    """Description of plain samples.

    Attributes
    ----------
    dtype : str
        Type of a number.
    samples : str
        ``complex``: I and Q alternate. ``blocks``: all I, then all Q, as in ``.iqw``. ``real``: neither.
    byte_order : str
    header : int
        Bytes before the first number.
    shape : tuple of int, optional
        Lengths of the axes, slowest first, without that of I and Q. Default: one axis.
    attributes : mapping
        Numbers, texts and lists that a layout can refer to.
    """

    dtype: Literal["int8", "int16", "int32", "float32", "float64"]
    samples: Literal["complex", "blocks", "real"]
    byte_order: Literal["little", "big"] = "little"
    header: Annotated[int, Field(ge=0)] = 0
    shape: tuple[Annotated[int, Field(ge=1)], ...] | None = None
    attributes: dict[str, float | str | tuple[float, ...]] = Field(default_factory=dict)


def sidecar(path: Path) -> Path:
    """Path of the sidecar of a file."""
    return path.with_name(path.name + ".toml")


def is_format(path: Path) -> bool:
    """Whether a sidecar stands beside the file."""
    return sidecar(path).is_file()


def content(path: Path) -> Content:
    """Describe plain samples; they stay in the file.

    Complex floating-point numbers are the dataset ``samples``; integers have an axis of I and Q at the end. Blocks are
    the datasets ``i`` and ``q``.

    Raises
    ------
    DataError
        The sidecar is malformed, or the file has another size than it says.
    """
    described = Sidecar.from_tables(read_toml(sidecar(path)), sidecar(path))
    dtype = np.dtype(described.dtype).newbyteorder("<" if described.byte_order == "little" else ">")
    parts = 1 if described.samples == "real" else 2
    stored = path.stat().st_size - described.header
    item = parts * dtype.itemsize
    shape = described.shape or (max(stored, 0) // item,)
    expected = int(np.prod(shape)) * item
    if stored != expected or not expected:
        raise DataError(
            f"{path}: {stored} bytes behind the header; {sidecar(path).name} says "
            f"{' x '.join(map(str, shape))} samples of {item} bytes, {expected}"
        )
    arrays: dict[str, Any]
    if described.samples == "blocks":
        first = PlainNumbers(path, dtype, shape, described.header)
        arrays = {"i": first, "q": PlainNumbers(path, dtype, shape, described.header + expected // 2)}
    elif described.samples == "complex" and dtype.kind == "f":
        joined = np.dtype(f"c{2 * dtype.itemsize}").newbyteorder(dtype.byteorder)
        arrays = {"samples": PlainNumbers(path, joined, shape, described.header)}
    else:
        full = (*shape, 2) if parts == 2 else shape
        arrays = {"samples": PlainNumbers(path, dtype, full, described.header)}
    attributes = {name: np.asarray(value) for name, value in described.attributes.items()}
    return Content("plain samples", arrays, attributes, (sidecar(path),))
