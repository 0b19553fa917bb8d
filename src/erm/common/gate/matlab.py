"""MATLAB files before version 7.3, read in a process of its own: nested cells or damaged lengths can crash the parser.

The process writes each variable as a line of JSON (name, type, shape) and its bytes. Nothing that it writes is run.
"""

import json
import sys
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import IO, Any

from erm.common.errors import DataError
from erm.common.gate import confined
from erm.common.gate.files import require_file
from erm.common.gate.limits import EXPANSION, current, too_large
from erm.common.printable import printable

SECONDS = 60
"""Processor time for one file [s]; chosen: a file as large as the limit of memory takes 10 s."""
MAX_LINE = 2**16
MAX_DEPTH = 8
"""Structures in structures that are read; chosen."""


def read_matlab(path: Path) -> dict[str, Any]:
    """Numbers and texts of a MATLAB file by name; those in structures as ``structure/field``. Cells are left out.

    Raises
    ------
    DataError
        It is no MATLAB file, is damaged, or is larger than the limits.
    """
    require_file(path)
    budget = current().max_bytes
    if path.stat().st_size > budget:
        raise DataError(f"{path}: {too_large(path.stat().st_size)}")
    tables: dict[str, Any] = {}
    with confined.start("erm.common.gate.matlab", str(path), str(budget)) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.close()
        try:
            finished = _receive(path, process.stdout, tables, budget)
        finally:
            process.kill()
    if not finished:
        raise DataError(f"{path}: damaged MATLAB file (reading it ends in {confined.KILLED}); export it again")
    return tables


def _receive(path: Path, stream: IO[bytes], tables: dict[str, Any], budget: int) -> bool:
    """Fill ``tables``; return whether the stream came to its end."""
    import numpy as np

    left = budget
    while line := stream.readline(MAX_LINE):
        try:
            head = json.loads(line)
        except ValueError:
            return False
        if "error" in head:
            raise DataError(f"{path}: {printable(str(head['error']))}")
        if "end" in head:
            return True
        dtype, shape = np.dtype(str(head["dtype"])), tuple(map(int, head["shape"]))
        length = dtype.itemsize * prod(shape)
        left -= length
        if left < 0:
            raise DataError(f"{path}: {too_large(budget - left)}")
        values = np.empty(shape, dtype)
        if length and stream.readinto(values.reshape(-1).view(np.uint8)) != length:  # type: ignore[attr-defined] # IO lacks it, files have it
            return False
        tables[str(head["name"])] = values
    return False


def main() -> None:
    """Read the file of the first argument within the bytes of the second, and write its variables."""
    path, budget = Path(sys.argv[1]), int(sys.argv[2])
    confined.limit(EXPANSION * budget, SECONDS)
    out = sys.stdout.buffer
    try:
        for name, values in _variables(path):
            head = {"name": name, "dtype": values.dtype.str, "shape": values.shape}
            out.write(json.dumps(head).encode() + b"\n" + values.tobytes())
        out.write(b'{"end": true}\n')
    except MemoryError:
        out.write(json.dumps({"error": too_large(EXPANSION * budget)}).encode() + b"\n")
    except Exception as error:  # the parser raises errors of many types for damaged files
        reason = " ".join(str(error).split()) or type(error).__name__
        text = f"not a MATLAB file, or a damaged one ({reason}); export it again"
        out.write(json.dumps({"error": text}).encode() + b"\n")
    out.flush()


def _variables(path: Path) -> Iterator[tuple[str, Any]]:
    import numpy as np
    from scipy.io import loadmat

    def walk(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
        if not isinstance(value, np.ndarray):
            return
        if value.dtype.names is None and value.dtype.kind in "biufcSU":
            yield name, np.ascontiguousarray(value)
        elif value.dtype.names is not None and value.size == 1 and depth:
            for field in value.dtype.names:
                yield from walk(f"{name}/{field}", value[field].item(), depth - 1)

    for name, value in loadmat(path).items():
        yield from walk(name, value, MAX_DEPTH)
