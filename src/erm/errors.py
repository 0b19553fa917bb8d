"""The error a user can act on."""


class DataError(Exception):
    """Something in a user's file or option is wrong.

    The message is one line: the file, what is there, what was expected, what to do. Command lines print it and
    exit with 1; a traceback would be a bug.
    """
