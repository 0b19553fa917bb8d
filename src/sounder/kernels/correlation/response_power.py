"""Loops between the transforms of power averaging: captures to rows of them, and the power of what they give."""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import jit, part, part_in_any_order

Array = Any

BISECTIONS = 16
"""Halvings of the interval of the median: it is known to 3e-5 of the root mean square, 2e-6 of the peak of one path."""


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
    """Median of values of mean zero, by bisection: its magnitude is at most the root mean square of the values.

    Of an even number it is the mean of the two values in the middle, where the bisection parts them.
    """
    high = root_mean_square(values)
    low, below_high = -high, np.int32(values.size)
    for _ in range(BISECTIONS):
        middle = np.float32(0.5) * (low + high)
        below = np.int32(0)
        for d in range(values.size):
            below += np.int32(values[d] < middle)
        if 2 * below < values.size:
            low = middle
        else:
            high, below_high = middle, below
    if 2 * below_high != values.size:
        return np.float32(0.5) * (low + high)
    lower, upper = np.float32(-np.inf), np.float32(np.inf)
    for d in range(values.size):
        if values[d] < high:
            lower = max(lower, values[d])
        else:
            upper = min(upper, values[d])
    return np.float32(0.5) * (lower + upper)


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
