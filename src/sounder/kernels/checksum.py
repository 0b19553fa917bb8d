"""Checksum of chunks of HDF5: filter fletcher32 of its file format."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import jit

BYTES = 4
"""Size of the checksum behind a chunk."""
MODULUS = 65535
"""Fletcher's sums of 16-bit words are modulo 2**16 - 1."""
PIECE = 256
"""Words that are summed at a time: the largest weighted sum, 2**16 * 2**8 * 2**8 / 2, fits 32 bits."""


def checksum_holds(chunk: bytes) -> bool:
    """Whether a chunk of an even number of bytes has the checksum that stands behind it.

    With the words ``w_1 ... w_n`` (big-endian), the sums are ``a = sum w_i`` and ``b = sum (n + 1 - i) w_i``, modulo
    2**16 - 1, in which 0 and 2**16 - 1 are the same. So is the exchange of the bytes of a word, which turns it by eight
    bits, and its product with 2**8: words are summed as the processor reads them.

    Examples
    --------
    >>> checksum_holds(bytes([0, 1, 0, 2, 3, 0, 4, 0])), checksum_holds(bytes([0, 1, 0, 3, 3, 0, 4, 0]))
    (True, False)
    """
    words = np.frombuffer(chunk, "<u2", count=(len(chunk) - BYTES) // 2)
    stored = np.frombuffer(chunk, "<u2", offset=len(chunk) - BYTES)
    sums = _sums(words.astype(np.uint16, copy=False))
    return all((2**8 * one - int(other)) % MODULUS == 0 for one, other in zip(sums, stored, strict=True))


@jit
def _sums(words: npt.NDArray[np.uint16]) -> tuple[int, int]:
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
