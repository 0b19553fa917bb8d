"""Health of samples: how many stand at the ends of the converter's range, and whether there is any signal."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compile import jit


@jit
def count_rails(flat: npt.NDArray[np.int16]) -> tuple[int, bool]:
    """Count the int16 numbers at -32768 or 32767, and tell whether any is not zero.

    Parameters
    ----------
    flat : array (number,)
        I and Q of any number of captures.
    """
    count = 0
    bits = np.int16(0)
    for k in range(flat.size):
        count += (flat[k] == 32767) | (flat[k] == -32768)
        bits |= flat[k]
    return count, bits != 0
