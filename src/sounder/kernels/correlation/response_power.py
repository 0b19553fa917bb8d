"""Loops between the transforms of power averaging: captures to rows of them, and the power of what they give."""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import jit, part, part_in_any_order

Array = Any

STEP = 2.0**-24
"""Steps in which a median is looked for, relative to the root mean square: those of single precision. The largest of N
numbers is ``sqrt(N)`` root mean squares, 2**9 of at most 2**18 samples, and fits int32 with room."""


@part
def load(x: Array, first: int, rows: Array) -> None:
    """Write captures (capture, number) from one on to the beginnings of rows, float32."""
    for k in range(min(rows.shape[0], x.shape[0] - first)):
        row, capture = rows[k], x[first + k]
        for t in range(capture.size):
            row[t] = np.float32(capture[t])
        row[capture.size :] = 0


@jit
def load_int16(x: Array, first: int, rows: Array) -> None:
    """`load`, of int16."""
    load(x, first, rows)


@jit
def load_float32(x: Array, first: int, rows: Array) -> None:
    """`load`, of float32."""
    load(x, first, rows)


@jit
def multiply(rows: Array, spectrum: Array) -> None:
    """Multiply rows (row, number), flat I/Q, by a spectrum (2, sample), real and imaginary parts, in place."""
    two, one = np.uint64(2), np.uint64(1)  # indices that cannot be negative: vectors of them are loaded
    for k in range(rows.shape[0]):
        row = rows[k]
        for d in range(spectrum.shape[1]):
            i = two * np.uint64(d)
            j = i + one
            real, imag = row[i], row[j]
            row[i] = real * spectrum[0, d] - imag * spectrum[1, d]
            row[j] = real * spectrum[1, d] + imag * spectrum[0, d]


@part_in_any_order
def fold(row: Array, planes: Array) -> None:
    """Write a row, flat I/Q, to planes (2, sample) of real and imaginary parts.

    What a linear convolution leaves behind the period is added to its beginning, which makes it circular.
    """
    real, imag = planes[0], planes[1]
    numbers = 2 * real.size
    late = row[numbers : 2 * numbers]
    for t in range(late.size):
        row[t] += late[t]
    two, one = np.uint64(2), np.uint64(1)
    for d in range(real.size):
        first = two * np.uint64(d)
        real[d], imag[d] = row[first], row[first + one]


@part_in_any_order
def mean_square(values: Array) -> Any:
    """Mean of the squares."""
    total = np.float32(0)
    for d in range(values.size):
        total += values[d] * values[d]
    return total / np.float32(values.size)


@part
def count_below(numbers: Array, bound: int) -> Any:
    """Count the int32 numbers below a bound."""
    count, least = np.int32(0), np.int32(bound)
    for d in range(numbers.size):  # numba adds to int64, of which a vector holds half as many
        count = np.int32(count + np.int32(numbers[d] < least))
    return count


@part
def neighbours(numbers: Array, bound: int) -> Any:
    """Largest of the int32 numbers below a bound, and smallest of the others."""
    least, lowest, highest = np.int32(bound), np.int32(-(2**31)), np.int32(2**31 - 1)
    below, above = lowest, highest
    for d in range(numbers.size):
        number = numbers[d]
        below = max(below, number if number < least else lowest)
        above = min(above, highest if number < least else number)
    return below, above


@part
def median(values: Array, numbers: Array) -> Any:
    """Median of values of mean zero: the mean of the two in the middle, which are one if their number is odd.

    Its magnitude is at most the root mean square of the values. Between these bounds a number is looked for that half
    of the values are below, by their counts in a straight line, and by bisection every third time. ``numbers``, int32,
    is work space for the values in whole steps.
    """
    square = mean_square(values)
    if not square > 0:
        return np.float32(0)
    step = np.float32(STEP * np.sqrt(square))
    scale = np.float32(1) / step
    for d in range(values.size):
        numbers[d] = np.int32(values[d] * scale)
    half = values.size // 2
    upper = int(2 / STEP)
    lower, below_lower, below_upper = -upper, 0, values.size
    rounds = 0
    while upper - lower > 1:
        rounds += 1
        share = (half - below_lower) / (below_upper - below_lower) if rounds % 3 else 0.5
        bound = min(max(lower + int(share * (upper - lower)), lower + 1), upper - 1)
        below_bound = count_below(numbers, bound)
        if below_bound == half:
            below, above = neighbours(numbers, bound)
            return step * np.float32(0.5 * (float(above) + float(above if values.size % 2 else below)))
        if below_bound < half:
            lower, below_lower = bound, below_bound
        else:
            upper, below_upper = bound, below_bound
    return step * np.float32(lower)  # values that are equal


@jit
def add_responses(rows: Array, planes: Array, numbers: Array, squares: Array, total: Array) -> None:
    """Add responses (row, number) without DC, less their medians, to sums: squares (sample,) and values (2, sample).

    Rows are flat I/Q, one period long, or two and more where they are to be folded, in place. ``planes`` and
    ``numbers``, int32 (sample,), are work space.
    """
    squares[:] = 0
    total[:] = 0
    for k in range(rows.shape[0]):
        fold(rows[k], planes)
        real, imag = median(planes[0], numbers), median(planes[1], numbers)
        for d in range(squares.size):
            planes[0, d] -= real
            planes[1, d] -= imag
            squares[d] += planes[0, d] * planes[0, d] + planes[1, d] * planes[1, d]
            total[0, d] += planes[0, d]
            total[1, d] += planes[1, d]
