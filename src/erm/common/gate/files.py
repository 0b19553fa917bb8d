"""Files that may be opened at all: regular ones, with content."""

import os
import stat
from pathlib import Path

from erm.common.errors import DataError
from erm.common.gate.limits import current, size, too_large


def require_file(path: Path, expected: str = "", *, may_be_empty: bool = False) -> None:
    """Refuse a path that is not a readable file with content.

    Devices, pipes and sockets are refused without being opened: reading them may never end.

    Parameters
    ----------
    path : Path
    expected : str
        What the file should be, for errors.
    may_be_empty : bool
        Accept a file without content.

    Raises
    ------
    DataError
        It is a folder, is missing, is no regular file, is empty, or must not be read.
    """
    wanted = f"; expected {expected}" if expected else ""
    try:
        facts = path.stat()
    except (OSError, ValueError) as error:  # ValueError: the name holds a zero byte
        reason = getattr(error, "strerror", None)
        what = "no such file" if isinstance(error, FileNotFoundError) else f"no such file ({reason or error})"
        raise DataError(f"{path}: {what}{wanted}") from None
    if stat.S_ISDIR(facts.st_mode):
        advice = wanted or f"; name the files in it, as in {path / '*'}"
        raise DataError(f"{path}: is a folder{advice}")
    if not stat.S_ISREG(facts.st_mode):
        raise DataError(f"{path}: is a device or a pipe; expected a file")
    if not os.access(path, os.R_OK):
        raise DataError(f"{path}: no permission to read it; ask its owner")
    if not facts.st_size and not may_be_empty:
        raise DataError(f"{path}: is empty{wanted or '; make or copy it again'}")


def read_bytes(path: Path, expected: str, *, limit: int | None = None, expansion: int = 1) -> bytes:
    """Read a small file.

    Parameters
    ----------
    path : Path
    expected : str
        What the file should be, for errors.
    limit : int, optional
        Largest size [byte]. Default: the limit of memory.
    expansion : int
        Memory that the content takes after parsing, relative to the size of the file.

    Raises
    ------
    DataError
        It is no file, is too large, or cannot be read.
    """
    require_file(path, expected, may_be_empty=True)
    length = path.stat().st_size
    if limit is not None and length > limit:
        raise DataError(f"{path}: has {size(length)}; expected {expected} of at most {size(limit)}")
    if length * expansion > current().max_bytes:
        raise DataError(f"{path}: {too_large(length * expansion)}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); expected {expected}") from None
