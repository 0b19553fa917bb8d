"""Sums of the checksum of chunks of HDF5: filter fletcher32 of its file format."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import jit

MODULUS = 65535
"""Fletcher's sums of 16-bit words are modulo 2**16 - 1."""
PIECE = 256
"""Words that are summed at a time: the largest weighted sum, 2**16 * 2**8 * 2**8 / 2, fits 32 bits."""


@jit
def fletcher_sums(words: npt.NDArray[np.uint16]) -> tuple[int, int]:
    """Sum of words (n,), and of each times ``n, n - 1 ... 1``; the second modulo 2**16 - 1."""
    plain = weighted = 0
    for first in range(0, words.size, PIECE):
        piece = words[first : first + PIECE]
        total, by_place = np.uint32(0), np.uint32(0)
        for k in range(piece.size):  # numba adds to int64, of which a vector holds half as many
            word = np.uint32(piece[k])
            total = np.uint32(total + word)
            by_place = np.uint32(by_place + np.uint32(word * np.uint32(k)))
        plain += int(total)
        weighted = (weighted + (words.size - first) * int(total) - int(by_place)) % MODULUS
    return plain, weighted
