"""Errors that a user can act on."""

import traceback
from pathlib import Path
from threading import Event

from erm.common.printable import printable

with_traceback = Event()
"""Set if internal errors are to show their traceback."""


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


def internal_error(error: BaseException) -> str:
    """One line for an error of this software: where it arose, what to do; after its traceback, if that is wanted."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "site-packages" not in frame.filename] or frames
    where = f" at {Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""
    text = printable(" ".join(str(error).split()))
    before = "".join(traceback.format_exception(error)) if with_traceback.is_set() else ""
    return (
        f"{before}internal error: {type(error).__name__}{where} ({text}); a fault of this software, not of your file: "
        "please run it again with --traceback before the command, and report what is printed"
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
