"""The errors a user can act on."""


class DataError(Exception):
    """Something in a user's file is wrong.

    The message is one line: the file, what is there, what was expected, what to do. Command lines print it and
    exit with 1; a traceback would be a bug.
    """


class OptionError(DataError):
    """An option is wrong whatever the files hold: command lines exit with 2."""
