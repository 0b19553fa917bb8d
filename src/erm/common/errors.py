"""Errors that a user can act on."""

import traceback
from pathlib import Path

from erm.common.printable import printable


class DataError(ValueError):
    """Something in a user's file or argument is wrong.

    The message is one line: the file, what was found, what was expected, what to do. Command lines print it and exit
    with code 1. A traceback would be a bug. Several errors that are raised as one have a line each. Control characters,
    which a hostile file can hold in its names, are escaped.

    Examples
    --------
    >>> import erm
    >>> erm.read_map("absent.geojson")
    Traceback (most recent call last):
    erm.common.errors.DataError: absent.geojson: no such file
    """

    def __init__(self, message: object) -> None:
        super().__init__("\n".join(map(printable, str(message).split("\n"))))


def unforeseen(error: BaseException) -> str:
    """One line for an error that no rule foresaw: a fault of this software, or too little memory."""
    if isinstance(error, MemoryError):
        return "the memory of this machine is not enough"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "site-packages" not in frame.filename] or frames
    where = f" at {Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""
    text = printable(" ".join(str(error).split()))
    return (
        f"unforeseen {type(error).__name__}{where} ({text}); a fault of this software: please report it with the file "
        "(--traceback before the command shows more)"
    )


class OptionError(DataError):
    """An option is wrong, whatever the files hold. Command lines exit with code 2.

    Examples
    --------
    >>> import erm
    >>> erm.write_map(erm.Environment.empty(), "map.obj", height=-1.0)
    Traceback (most recent call last):
    erm.common.errors.OptionError: map.obj: height -1 m, margin 50 m; expected positive numbers
    """
