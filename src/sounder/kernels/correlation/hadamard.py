"""Correlation with an m-sequence by the Walsh-Hadamard transform, in plain loops.

The circular correlation of N = 2**m - 1 chips with an m-sequence is a permuted Walsh-Hadamard transform [1]_,
[2]_: write sample n to row ``input[n]`` of z (row 0 stays zero), transform, and read delay k from row
``output[k]`` (`sounder.kernels.correlation.permutations`). That is m * 2**m additions and no multiplication.

With ``spc`` samples held per chip, the matched filter of a chip is the running sum over spc samples,

    u[n, c] = sum_q x[spc*n + c + q],    q = 0..spc-1,    c = 0..spc-1,

after which each of the spc polyphase streams u[:, c] is an ordinary sequence of N chips; its correlation at
chip k is the correlation of the capture at delay ``spc*k + c`` samples. The streams, in I and Q, are
transformed side by side: a row of z holds the 2*spc numbers of a chip, and every butterfly is a sum of rows.

References
----------
.. [1] M. Cohn and A. Lempel, "On fast M-sequence transforms", IEEE Trans. Inf. Theory 23(1), 1977.
.. [2] J. Borish and J. B. Angell, "An efficient algorithm for measuring the impulse response using pseudorandom
   noise", J. Audio Eng. Soc. 31(7), 1983.
"""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import part, part_with_literals

Array = Any

ROW = 16
"""Numbers of a row: float32, a cache line."""


@part
def chip_sums(capture: Array, spc: int, sums: Array) -> None:
    """Sum the spc samples from each sample on: flat I/Q; the capture's beginning is repeated behind its end."""
    if spc == 2:
        for t in range(sums.size):
            sums[t] = capture[t] + capture[t + 2]
        return
    for t in range(sums.size):
        sums[t] = capture[t]
    for q in range(1, spc):
        for t in range(sums.size):
            sums[t] += capture[t + 2 * q]


@part
def gather(sums: Array, chips: Array, spc: int, chip: int, z: Array) -> None:
    """Fill row r of z with chip ``chips[r]`` of each capture in ``sums`` (capture, number), flat; row 0 with zeros.

    Rows are written in their order: processors read here and there faster than they write.
    """
    captures, numbers = ROW // chip, 2 * spc * (chips.size - 1)
    z[:ROW] = 0
    if spc == 2:  # a chip is as large as a number of complex128
        pairs, places = sums.view(np.complex128), z.view(np.complex128)
        for r in range(1, chips.size):
            for c in range(captures):
                places[np.uint64(captures * r + c)] = pairs[np.uint64(c * (numbers // chip) + chips[r])]
        return
    for r in range(1, chips.size):
        for c in range(captures):
            for t in range(2 * spc):
                z[ROW * r + chip * c + t] = sums[numbers * c + 2 * spc * chips[r] + t]


@part
def walsh_hadamard(z: Array) -> None:
    """Transform z (flat, 2**m rows of :data:`ROW`, m = 7 to 15) over its rows, natural order, in place.

    Radix 8 as often as possible, then 4 or 2. The additions are those of radix 2 in their order, so that the result is
    the same to the last bit.
    """
    radix_8(z, 16)
    radix_8(z, 128)
    half = 1024
    if z.size >= 8192:
        radix_8(z, 1024)
        half = 8192
    if z.size >= 65536:
        radix_8(z, 8192)
        half = 65536
    if z.size >= 524288:
        radix_8(z, 65536)
        half = 524288
    if 4 * half <= z.size:
        for start in range(0, z.size, 4 * half):
            a = z[start : start + half]
            b = z[start + half : start + 2 * half]
            c = z[start + 2 * half : start + 3 * half]
            d = z[start + 3 * half : start + 4 * half]
            for k in range(half):
                s, t, v, w = a[k] + b[k], a[k] - b[k], c[k] + d[k], c[k] - d[k]
                a[k], b[k], c[k], d[k] = s + v, t + w, s - v, t - w
        half *= 4
    if half < z.size:
        a, b = z[:half], z[half:]
        for k in range(half):
            a[k], b[k] = a[k] + b[k], a[k] - b[k]


@part_with_literals
def radix_8(z: Array, half: int) -> None:
    """Transform over three bits of the row, those worth ``half``, ``2 * half`` and ``4 * half`` numbers.

    With a number that is written in the source and indices that cannot be negative, the compiler knows that the eight
    numbers are apart, and takes as many columns at a time as a register holds.
    """
    h, two, four = np.uint64(half), np.uint64(2 * half), np.uint64(4 * half)
    for start in range(0, z.size, 8 * half):
        for column in range(half):
            i = np.uint64(start) + np.uint64(column)
            j, k, m = i + h, i + two, i + two + h
            n, o, p, q = i + four, j + four, k + four, m + four
            a, b, c, d = z[i] + z[j], z[i] - z[j], z[k] + z[m], z[k] - z[m]
            s, t, v, w = z[n] + z[o], z[n] - z[o], z[p] + z[q], z[p] - z[q]
            a, b, c, d = a + c, b + d, a - c, b - d
            s, t, v, w = s + v, t + w, s - v, t - w
            z[i], z[j], z[k], z[m] = a + s, b + t, c + v, d + w
            z[n], z[o], z[p], z[q] = a - s, b - t, c - v, d - w


@part
def unpermute(z: Array, stride: int, positions: Array, spc: int, scale: float, out: Array) -> None:
    """Read the chip of delay k, 2*spc numbers, at ``stride * positions[k]``, times a scale."""
    width = 2 * spc
    for k in range(positions.size):
        p = stride * positions[k]
        for c in range(width):
            out[width * k + c] = scale * z[p + c]
