"""A pulse of known shape in a row of samples: its value at the samples around a delay, and sums over these.

The pulse is tabulated ``oversampling`` times a sample and linear between; delays are circular.
"""

import math

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part

Cir = npt.NDArray[np.complex64]
Table = npt.NDArray[np.complex128]


@part
def power(value: complex) -> float:
    """Squared magnitude."""
    # written out, here and below: what numba calls for powers, products and quotients of numbers takes long to compile
    return value.real * value.real + value.imag * value.imag


@part
def times(a: complex, b: complex) -> complex:
    """Product of two numbers."""
    return complex(a.real * b.real - a.imag * b.imag, a.real * b.imag + a.imag * b.real)


@part
def nearest(delay: float) -> int:
    """Round half up, in a type that indexes."""
    return math.floor(delay + 0.5)


@part
def sample(table: Table, oversampling: int, delay: float, taps: Table) -> int:
    """Fill ``taps`` with the pulse at the samples around ``delay``; return the first of these, maybe negative.

    The table holds one sample more to either side than there are taps to either side of the middle one.
    """
    first = nearest(delay) - taps.size // 2
    place = (first - delay) * oversampling + 0.5 * (table.size - 1)
    left = math.floor(place)
    right = place - left
    for i in range(taps.size):
        here, there = table[left], table[left + 1]
        taps[i] = complex(
            here.real * (1.0 - right) + there.real * right, here.imag * (1.0 - right) + there.imag * right
        )
        left += oversampling
    return first


@part
def match(cir: Cir, b: int, first: int, taps: Table) -> complex:
    """Sum of a beam's samples times taps, without conjugation."""
    total = 0j
    size = cir.shape[1]
    k = first % size
    for i in range(taps.size):
        total += times(complex(cir[b, k]), taps[i])
        k += 1
        if k == size:
            k = 0
    return total


@part
def add(cir: Cir, b: int, first: int, taps: Table, amplitude: complex) -> None:
    """Add a pulse to a beam."""
    size = cir.shape[1]
    k = first % size
    for i in range(taps.size):
        cir[b, k] += times(amplitude, taps[i])
        k += 1
        if k == size:
            k = 0


@part
def power_around(cir: Cir, b: int, delay: float) -> float:
    """Mean power within two samples of a delay."""
    size = cir.shape[1]
    centre = nearest(delay)
    total = 0.0
    for k in range(centre - 2, centre + 3):
        total += power(complex(cir[b, k % size]))
    return total / 5
