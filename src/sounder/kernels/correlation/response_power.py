"""Loops between the transforms of power averaging: captures to rows of them, and the power of what they give."""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import jit, part, part_in_any_order

Array = Any

BISECTIONS = 13
"""Halvings of the interval of the median: it is known to 1.2e-4 of the root mean square, which for a path that fills a
chip of 511 is 5e-6 of the peak."""


@part
def load(x: Array, first: int, rows: Array) -> None:
    """Write captures (capture, number) from one on to the beginnings of rows, float32."""
    for k in range(min(rows.shape[0], x.shape[0] - first)):
        row, capture = rows[k], x[first + k]
        for t in range(capture.size):
            row[t] = np.float32(capture[t])


@jit
def load_int16(x: Array, first: int, rows: Array) -> None:
    """`load`, of int16."""
    load(x, first, rows)


@jit
def load_float32(x: Array, first: int, rows: Array) -> None:
    """`load`, of float32."""
    load(x, first, rows)


@part
def fold(row: Array, planes: Array) -> None:
    """Write a row, flat I/Q, to planes (2, sample) of real and imaginary parts.

    What a linear convolution leaves behind the period is added to its beginning, which makes it circular.
    """
    period = planes.shape[1]
    pairs = row.reshape(row.size // 2, 2)
    for d in range(period):
        planes[0, d] = pairs[d, 0]
        planes[1, d] = pairs[d, 1]
    if pairs.shape[0] > period:
        late = pairs[period:]
        for d in range(period):
            planes[0, d] += late[d, 0]
            planes[1, d] += late[d, 1]


@part_in_any_order
def root_mean_square(values: Array) -> Any:
    """Root of the mean square."""
    total = np.float32(0)
    for d in range(values.size):
        total += values[d] * values[d]
    return np.sqrt(total / values.size)


@part
def median(values: Array) -> Any:
    """Median of values of mean zero: the mean of the two in the middle, which are one if their number is odd.

    Both are found by bisection: their magnitude is at most the root mean square of the values.
    """
    lower_rank, upper_rank = np.int32((values.size - 1) // 2), np.int32(values.size // 2)
    bound = root_mean_square(values)
    lower, upper, step = -bound, -bound, bound
    for _ in range(BISECTIONS):
        first, second = lower + step, upper + step
        below_first, below_second = np.int32(0), np.int32(0)
        for d in range(values.size):
            # numba adds to int64, of which a vector holds half as many
            below_first = np.int32(below_first + np.int32(values[d] < first))
            below_second = np.int32(below_second + np.int32(values[d] < second))
        if below_first <= lower_rank:
            lower = first
        if below_second <= upper_rank:
            upper = second
        step *= np.float32(0.5)
    return np.float32(0.5) * (lower + upper) + step


@jit
def add_responses(rows: Array, planes: Array, squares: Array, total: Array) -> None:
    """Add responses (row, number) without DC, less their medians, to sums: squares (sample,) and values (2, sample).

    Rows are flat I/Q, one period long, or two and more where they are to be folded. ``planes`` is work space.
    """
    squares[:] = 0
    total[:] = 0
    for k in range(rows.shape[0]):
        fold(rows[k], planes)
        real, imag = median(planes[0]), median(planes[1])
        for d in range(squares.size):
            planes[0, d] -= real
            planes[1, d] -= imag
            squares[d] += planes[0, d] * planes[0, d] + planes[1, d] * planes[1, d]
            total[0, d] += planes[0, d]
            total[1, d] += planes[1, d]
