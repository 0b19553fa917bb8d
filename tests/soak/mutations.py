"""Files that are damaged at random: in their bytes, in their words, in the structure of HDF5."""

import re
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

WORDS = (
    *(b"nan", b"inf", b"-1", b"0", b"1e999", b"1e308", b"1e-320", b"-0.0", b"9" * 400, b"null", b"true", b"{}", b"[]"),
    *(
        b"[" * 3000,
        b'""',
        b"'",
        b'"',
        b"\n",
        b",",
        b"\x00",
        b"\xff",
        b"\x1b[2J",
        b"\xe2\x80\xae",
        b"/etc/passwd",
        b"../",
    ),
)
SEPARATORS = rb'[^\s,=:;<>()\[\]{}"]+'
NEAR = 4096
"""Distance from the beginning of a dataset within which HDF5 keeps what describes it [byte]; chosen."""


def mutated(path: Path, others: Sequence[Path], rng: np.random.Generator) -> bytes:
    """Content of a damaged copy of a file; pieces of ``others`` may get into it."""
    data = path.read_bytes()
    if rng.random() < 0.02:
        return others[rng.integers(len(others))].read_bytes()
    if h5py.is_hdf5(path):
        return _restructured(path, rng) if rng.random() < 0.3 else _bytes(data, _near_objects(path, rng), others, rng)
    if rng.random() < 0.5 and _is_text(data):
        return _words(data, rng)
    return _bytes(data, int(rng.integers(len(data))), others, rng)


def _is_text(data: bytes) -> bool:
    return b"\0" not in data[:NEAR]


def _bytes(data: bytes, at: int, others: Sequence[Path], rng: np.random.Generator) -> bytes:
    """Change a bit; replace, cut out or put in some bytes; cut the end off."""
    length = int(2 ** rng.integers(10))
    kind = rng.integers(8)
    if kind < 3:
        return data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :]
    if kind == 3:
        other = others[rng.integers(len(others))].read_bytes()
        start = int(rng.integers(len(other)))
        pieces = (bytes(length), b"\xff" * length, rng.bytes(length), other[start : start + length])
        piece = pieces[rng.integers(len(pieces))]
        return data[:at] + piece + data[at + len(piece) :]
    if kind == 4:
        number = int(2 ** rng.uniform(0, 63)).to_bytes(8, "little")[: 2 ** rng.integers(4)]
        return data[:at] + number + data[at + len(number) :]
    if kind == 5:
        return data[:at]
    if kind == 6:
        return data[:at] + data[at + length :]
    return data[:at] + WORDS[rng.integers(len(WORDS))] + data[at:]


def _words(data: bytes, rng: np.random.Generator) -> bytes:
    """Exchange a word for an odd one or for another of the file, or exchange two lines."""
    places = [found.span() for found in re.finditer(SEPARATORS, data)]
    if rng.random() < 0.2 or not places:
        lines = data.split(b"\n")
        i, j = rng.integers(len(lines), size=2)
        lines[i], lines[j] = lines[j], lines[i]
        return b"\n".join(lines)
    begin, end = places[rng.integers(len(places))]
    first, last = places[rng.integers(len(places))]
    word = data[first:last] if rng.random() < 0.2 else WORDS[rng.integers(len(WORDS))]
    return data[:begin] + word + data[end:]


def _near_objects(path: Path, rng: np.random.Generator) -> int:
    """Place in an HDF5 file, mostly in what describes its content: that is small, and rarely hit by chance."""
    size = path.stat().st_size
    if rng.random() < 0.3:
        return int(rng.integers(size))
    places = [0]

    def note(_: str, node: h5py.Group | h5py.Dataset) -> None:
        places.append(h5py.h5o.get_info(node.id).addr)

    with h5py.File(path) as file:
        file.visititems(note)
    return min(int(places[rng.integers(len(places))] + abs(rng.normal()) * NEAR / 8), size - 1)


def _restructured(path: Path, rng: np.random.Generator) -> bytes:
    """Remove, exchange or convert a dataset, or change an attribute, as other software may do it."""
    copy = path.with_name("restructured")
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        sets = [name for name in names if isinstance(file[name], h5py.Dataset) and file[name].shape is not None]
        name, other = (sets[i] for i in rng.integers(len(sets), size=2))
        kind = rng.integers(6)
        if kind < 4:
            values = np.asarray(file[name][()])
            if kind == 1 and name != other:
                file.move(other, "moved")
                file.move(name, other)
                file.move("moved", name)
            else:
                del file[name]
                if kind == 2:
                    file[name] = values.T if values.ndim > 1 else values.ravel()[:-1]
                elif kind == 3:
                    file[name] = (
                        [*values.astype("S8").ravel()] if values.dtype.kind in "fiu" else np.arange(values.size)
                    )
        else:
            node = file[[*names, "/"][rng.integers(len(names) + 1)]]
            if keys := [key for key in node.attrs if key not in ("DIMENSION_LIST", "REFERENCE_LIST")]:
                odd = (
                    np.nan,
                    -1,
                    1e308,
                    0,
                    "",
                    "\x1b]0;x\x07",
                    "x" * 70_000,
                    np.zeros((3, 3)),
                    h5py.Empty("f8"),
                    b"\xff",
                )
                node.attrs[keys[rng.integers(len(keys))]] = odd[rng.integers(len(odd))]
    data = copy.read_bytes()
    copy.unlink()
    return data
