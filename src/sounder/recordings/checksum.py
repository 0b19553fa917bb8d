"""Checksum of chunks of HDF5: filter fletcher32 of its file format."""

import sys

import numpy as np

BYTES = 4
"""Size of the checksum behind a chunk."""


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
    if "numba" in sys.modules:  # who only looks at a file does not wait for it
        from sounder.kernels.checksum import fletcher_sums

        sums = fletcher_sums(words.astype(np.uint16, copy=False))
    else:
        weights = np.arange(words.size, 0, -1, dtype=np.uint64)
        sums = int(words.sum(dtype=np.uint64)), int(words.astype(np.uint64) @ weights)
    return all((2**8 * one - int(other)) % (2**16 - 1) == 0 for one, other in zip(sums, stored, strict=True))
