"""Correlation with an m-sequence by the Walsh-Hadamard transform, in plain loops.

The circular correlation of N = 2**m - 1 chips with an m-sequence is a permuted Walsh-Hadamard transform [1]_,
[2]_: write sample n to row ``input[n]`` of z (row 0 stays zero), transform, and read delay k from row
``output[k]`` (`mls.permutations`). That is m * 2**m additions and no multiplication.

With ``spc`` samples held per chip, the matched filter of a chip is the running sum over spc samples,

    u[n, c] = sum_q x[spc*n + c + q],    q = 0..spc-1,    c = 0..spc-1,

after which each of the spc polyphase streams u[:, c] is an ordinary sequence of N chips; its correlation at
chip k is the correlation of the capture at delay ``spc*k + c`` samples. The streams, in I and Q, are
transformed side by side: a row of z holds the 2*spc numbers of a chip, and every butterfly is a sum of rows.

References
----------
.. [1] M. Cohn and A. Lempel, "On fast M-sequence transforms", IEEE Trans. Inf. Theory 23(1), 1977.
.. [2] J. Borish and J. B. Angell, "An efficient algorithm for measuring the impulse response using
pseudorandom
   noise", J. Audio Eng. Soc. 31(7), 1983.
"""

from typing import Any

from sounder.kernels.compile import part

Array = Any


@part
def scatter(e: Array, rows: Array, spc: int, row: int, first: int, z: Array) -> None:
    """Sum the samples of chip n of the wrapped capture e into row ``rows[n]`` of z, at column ``first``."""
    if spc == 1:
        for n in range(rows.size):
            p = row * rows[n] + first
            for c in range(2):
                z[p + c] = e[2 * n + c]
    elif spc == 2:
        for n in range(rows.size):
            p = row * rows[n] + first
            for c in range(4):
                z[p + c] = e[4 * n + c] + e[4 * n + c + 2]
    elif spc == 3:
        for n in range(rows.size):
            p = row * rows[n] + first
            for c in range(6):
                z[p + c] = (e[6 * n + c] + e[6 * n + c + 2]) + e[6 * n + c + 4]
    else:
        for n in range(rows.size):
            p = row * rows[n] + first
            for c in range(8):
                z[p + c] = (e[8 * n + c] + e[8 * n + c + 2]) + (e[8 * n + c + 4] + e[8 * n + c + 6])


@part
def walsh_hadamard(z: Array, row: int) -> None:
    """Transform z (flat, 2**m rows) over its rows, natural order, in place: radix 4, then 2 if m is odd."""
    half = row
    while half * 4 <= z.size:
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


@part
def wrap(e: Array, length: int) -> None:
    """Repeat the beginning of the capture behind its end, as far as the last chip's sums reach."""
    for t in range(8):
        e[length + t] = e[t]


@part
def unpermute(
    z: Array, stride: int, first: int, positions: Array, spc: int, scale: float, out: Array
) -> None:
    """Read delay k from row ``positions[k]`` of z (rows ``stride`` apart), from column ``first`` on."""
    width = 2 * spc
    for k in range(positions.size):
        p = stride * positions[k] + first
        for c in range(width):
            out[width * k + c] = scale * z[p + c]
