"""Correlation with an m-sequence by the Walsh-Hadamard transform, in plain loops.

The circular correlation of N = 2**m - 1 chips with an m-sequence is a permuted Walsh-Hadamard transform [1]_, [2]_:
write sample n to row ``input[n]`` of z (row 0 stays zero), transform, and read delay k from row ``output[k]``
(`mls.permutations`). That is m * 2**m additions and no multiplication.

With ``spc`` samples held per chip, the matched filter of a chip is the running sum over spc samples,

    u[n, c] = sum_q x[spc*n + c + q],    q = 0..spc-1,    c = 0..spc-1,

after which each of the spc polyphase streams u[:, c] is an ordinary sequence of N chips; its correlation at chip k is
the correlation of the capture at delay ``spc*k + c`` samples. The streams, in I and Q, are transformed side by side:
a chip is 2*spc numbers (padded to 8 for spc = 3), and ``16 // chip`` captures share a row of 16 numbers, so that all
butterflies are sums of rows.

A capture always takes the slot of a row that its position in the whole recording gives it: sums are then made in the
same order whatever blocks the recording arrives in, and results do not depend on the blocks, to the last bit.

References
----------
.. [1] M. Cohn and A. Lempel, "On fast M-sequence transforms", IEEE Trans. Inf. Theory 23(1), 1977.
.. [2] J. Borish and J. B. Angell, "An efficient algorithm for measuring the impulse response using pseudorandom
   noise", J. Audio Eng. Soc. 31(7), 1983.
"""

import numpy as np

from sounder.kernels.compile import jit, part

ROW = 16
F = np.float32


@part
def chip_sums(x, spc, chip, u):
    """Running sum over the samples of a chip: flat I/Q numbers x -> u[chips * chip], padded when spc is 3."""
    length = x.size
    width = 2 * spc
    if spc == 1:
        for t in range(length):
            u[t] = F(x[t])
    elif spc == 2:
        for t in range(length - 2):
            u[t] = F(x[t]) + F(x[t + 2])
        for t in range(length - 2, length):
            u[t] = F(x[t]) + F(x[t + 2 - length])
    elif spc == 4:
        for t in range(length - 6):
            u[t] = (F(x[t]) + F(x[t + 2])) + (F(x[t + 4]) + F(x[t + 6]))
        for t in range(length - 6, length):
            u[t] = (F(x[t]) + F(x[(t + 2) % length])) + (F(x[(t + 4) % length]) + F(x[(t + 6) % length]))
    else:
        chips = length // width
        for n in range(chips - 1):
            for c in range(6):
                t = 6 * n + c
                u[8 * n + c] = (F(x[t]) + F(x[t + 2])) + F(x[t + 4])
        for c in range(6):
            t = length - 6 + c
            u[chip * (chips - 1) + c] = (F(x[t]) + F(x[(t + 2) % length])) + F(x[(t + 4) % length])


@part
def scatter(u, rows, chip, slot, z):
    """Write chip n of u to row ``rows[n]`` of z (flat, rows of 16), at the given slot of the row."""
    first = slot * chip
    if chip == 2:
        for n in range(rows.size):
            p = ROW * rows[n] + first
            for c in range(2):
                z[p + c] = u[2 * n + c]
    elif chip == 4:
        for n in range(rows.size):
            p = ROW * rows[n] + first
            for c in range(4):
                z[p + c] = u[4 * n + c]
    else:
        for n in range(rows.size):
            p = ROW * rows[n] + first
            for c in range(8):
                z[p + c] = u[8 * n + c]


@part
def walsh_hadamard(z):
    """Transform z (flat, 2**m rows of 16 numbers) over its rows, natural order, in place."""
    half = ROW
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
def transform_group(x, first, last, slot, spc, chip, rows, u, z):
    """Transform captures first..last-1 of x side by side, the first of them in the given slot."""
    z[:] = F(0)
    for i in range(first, last):
        chip_sums(x[i], spc, chip, u)
        scatter(u, rows, chip, slot + i - first, z)
    walsh_hadamard(z)
