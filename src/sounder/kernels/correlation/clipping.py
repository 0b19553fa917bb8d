"""Health of samples: how many stand at the ends of the converter's range, and whether there is any signal."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import jit
from sounder.kernels.correlation.captures import Captures

PIECE = 1 << 14  # numbers counted at a time: all of them at the ends fit int16


def count_rails(captures: Captures) -> tuple[int, bool]:
    """Count the int16 numbers at -32768 or 32767, and tell whether any is not zero.

    Parameters
    ----------
    captures : array int16 (...)
        I and Q of any number of captures.
    """
    flat = np.ascontiguousarray(captures, np.int16).reshape(-1).view()
    flat.flags.writeable = False  # as mapped files are: the kernel is compiled for one type of array
    return _count(flat)


@jit
def _count(flat: npt.NDArray[np.int16]) -> tuple[int, bool]:
    count = 0
    bits = np.int16(0)
    # sums of int16 stay in vectors of 32; in 64 bits, as numba adds, counting takes four times as long
    for first in range(0, flat.size, PIECE):
        piece = flat[first : first + PIECE]
        rails = np.int16(0)
        for k in range(piece.size):
            number = piece[k]
            rails = np.int16(rails + np.int16((number == 32767) | (number == -32768)))
            bits = np.int16(bits | number)
        count += int(rails)
    return count, bits != 0
