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

from sounder.kernels.compiler.compile import part

Array = Any


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
def scatter(sums: Array, rows: Array, spc: int, stride: int, first: int, z: Array) -> None:
    """Write chip n (spc complex numbers) to row ``rows[n]`` of z, ``stride`` apart, from ``first`` on."""
    if spc == 2:
        for n in range(rows.size):
            p = stride * rows[n] + first
            even, odd = sums[2 * n], sums[2 * n + 1]
            z[p], z[p + 1] = even, odd
        return
    for n in range(rows.size):
        p = stride * rows[n] + first
        for c in range(spc):
            z[p + c] = sums[spc * n + c]


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
def unpermute(z: Array, stride: int, positions: Array, spc: int, scale: float, out: Array) -> None:
    """Read the chip of delay k, 2*spc numbers, at ``stride * positions[k]``, times a scale."""
    width = 2 * spc
    for k in range(positions.size):
        p = stride * positions[k]
        for c in range(width):
            out[width * k + c] = scale * z[p + c]
