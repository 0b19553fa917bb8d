"""What a compiled correlator is given: its constant tables, and the sums it works on."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

LINE = 64
"""Bytes of a cache line, and of the widest vector load."""
TAIL = 8
"""Numbers of a capture's beginning that are repeated behind its end: 4 samples of I and Q, the longest chip."""

Array = Any


class Tables(NamedTuple):
    """Constants of one sequence at one number of samples per chip, in the layout of one path.

    The transform is a flat array of float32. The chip of delay k begins ``stride * positions[k]`` numbers
    from its start; where several captures share a stride, each has ``chip`` numbers of it.

    Attributes
    ----------
    samples_per_chip, chip, stride : int
    gather : array
        Where the path finds the chips of its rows.
    positions : array (chip,)
    rows, delays : array (chip,)
        `Permutations.input` and `Permutations.output`.
    polarity : float
    number_order : array (number,)
        Number of a capture that is summed at each place of `State.samples`; empty if in order.
    """

    samples_per_chip: int
    chip: int
    stride: int
    gather: Array
    positions: Array
    rows: Array
    delays: Array
    polarity: float
    number_order: Array


class Kernels(NamedTuple):
    """Entry points of one path."""

    add_int16: Callable[..., None]
    add_float32: Callable[..., None]
    means: Callable[..., None]
    correlate_float32: Callable[..., None]


class State(NamedTuple):
    """Work space and running sums of one thread.

    Attributes
    ----------
    staged : array int16
        Two captures, wrapped.
    capture : array float32
        One capture, wrapped.
    sums : array float32
        Its sums over the samples of a chip.
    z : array float32
        The transform; where captures share rows, zero between calls.
    power, power_total : array float32, float64
        Sum of the squares of z: since the last flush, and before.
    samples, samples_total : array int32, float64
        Sum of the captures: since the last flush, and before.
    """

    staged: Array
    capture: Array
    sums: Array
    z: Array
    power: Array
    power_total: Array
    samples: Array
    samples_total: Array


def new_state(staged: int, capture: int, sums: int, transform: int, samples: int) -> State:
    """Allocate a state of these sizes, all sums zero."""
    return State(
        aligned_zeros(staged, np.int16),
        aligned_zeros(capture, np.float32),
        aligned_zeros(sums, np.float32),
        aligned_zeros(transform, np.float32),
        aligned_zeros(transform, np.float32),
        aligned_zeros(transform, np.float64),
        aligned_zeros(samples, np.int32),
        aligned_zeros(samples, np.float64),
    )


def aligned_zeros(size: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Allocate zeros that begin on a cache line: vector loads and stores may need that."""
    kind = np.dtype(dtype)
    memory = np.zeros(size * kind.itemsize + LINE, np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size * kind.itemsize].view(kind)
