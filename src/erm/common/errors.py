"""Errors that a user can act on."""


class DataError(ValueError):
    """Something in a user's file or argument is wrong.

    The message is one line: the file, what was found, what was expected, what to do. Command lines print it and exit
    with code 1. A traceback would be a bug.

    Examples
    --------
    >>> import erm
    >>> erm.read_map("absent.geojson")
    Traceback (most recent call last):
    erm.common.errors.DataError: absent.geojson: no such file
    """


class OptionError(DataError):
    """An option is wrong, whatever the files hold. Command lines exit with code 2.

    Examples
    --------
    >>> import erm
    >>> erm.write_map(erm.Environment.empty(), "map.obj", height=-1.0)
    Traceback (most recent call last):
    erm.common.errors.OptionError: map.obj: height -1 m, margin 50 m; expected positive numbers
    """
