"""Health of samples: how many stand at the ends of the converter's range, and whether there is any signal."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.captures import Captures
from sounder.kernels.compile import jit


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
    for k in range(flat.size):
        count += (flat[k] == 32767) | (flat[k] == -32768)
        bits |= flat[k]
    return count, bits != 0
