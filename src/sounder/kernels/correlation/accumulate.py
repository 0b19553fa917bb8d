"""Sums over snapshots: partial sums in single precision or integers, totals in double precision."""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import part

Array = Any

FLUSH_POWER = 32
"""Captures after which the sum of powers moves to its total. Equal captures round alike: n additions of one float32
number are off by at most n/8 of its last bits, 5e-7 for 32."""
FLUSH_SAMPLES = 1 << 14
"""Captures after which the sum of samples moves to its total; int32 holds 65535 sums of int16."""


@part
def clear(partial: Array, total: Array) -> None:
    """Set a sum to zero."""
    for k in range(partial.size):
        partial[k] = 0
        total[k] = 0


@part
def flush(partial: Array, total: Array) -> None:
    """Move a partial sum into its total before it loses precision or overflows."""
    for k in range(partial.size):
        total[k] += partial[k]
        partial[k] = 0


@part
def flush_permuted(partial: Array, order: Array, total: Array) -> None:
    """Like `flush`, where number k of the partial sum belongs to number ``order[k]`` of the total."""
    for k in range(partial.size):
        total[order[k]] += partial[k]
        partial[k] = 0


@part
def mean_power(
    partial: Array, total: Array, count: int, spc: int, chip: int, stride: int, positions: Array, out: Array
) -> None:
    """Write the mean of |correlation|**2: sum I and Q, and the captures that share a stride."""
    scale = 1.0 / count
    for k in range(positions.size):
        first = stride * positions[k]
        for c in range(spc):
            value = 0.0
            for p in range(first + 2 * c, first + stride, chip):
                value += (total[p] + partial[p]) + (total[p + 1] + partial[p + 1])
            out[spc * k + c] = value * scale


@part
def mean_capture(partial: Array, total: Array, count: int, out: Array) -> None:
    """Write the mean of the captures, in the precision of the transforms."""
    scale = 1.0 / count
    for t in range(partial.size if partial.size < out.size else out.size):
        out[t] = np.float32((total[t] + partial[t]) * scale)
