"""Health of samples: how many stand at the ends of the converter's range, and whether there is any signal."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import jit
from sounder.kernels.correlation.captures import Captures

PIECE = 1 << 14
"""Numbers counted at a time, fewer than the largest int16: the count of a piece fits int16."""


def count_rails(captures: Captures) -> tuple[int, bool]:
    """Count the int16 numbers at -32768 or 32767, and tell whether any is not zero.

    Parameters
    ----------
    captures : array int16 (...)
        I and Q of any number of captures.

    Returns
    -------
    count : int
    signal : bool

    Examples
    --------
    >>> count_rails(np.array([[3, -32768], [32767, 0]], np.int16))
    (2, True)
    """
    flat = np.ascontiguousarray(captures, np.int16).reshape(-1).view()
    flat.flags.writeable = False  # as mapped files are: the kernel is compiled for one type of array
    return _count(flat)


@jit
def _count(flat: npt.NDArray[np.int16]) -> tuple[int, bool]:
    count = 0
    bits = np.int16(0)
    # int16 keeps four times as many numbers in a vector as the int64 that numba adds by default
    for first in range(0, flat.size, PIECE):
        piece = flat[first : first + PIECE]
        rails = np.int16(0)
        for k in range(piece.size):
            number = piece[k]
            rails = np.int16(rails + np.int16((number == 32767) | (number == -32768)))
            bits = np.int16(bits | number)
        count += int(rails)
    return count, bits != 0
