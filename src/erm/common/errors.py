"""Errors that a user can act on."""

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


class OptionError(DataError):
    """An option is wrong, whatever the files hold. Command lines exit with code 2.

    Examples
    --------
    >>> import erm
    >>> erm.write_map(erm.Environment.empty(), "map.obj", height=-1.0)
    Traceback (most recent call last):
    erm.common.errors.OptionError: map.obj: height -1 m, margin 50 m; expected positive numbers
    """
