"""What a compiled correlator is given: its constant tables, and the sums it works on."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

LINE = 64

Array = Any


class Tables(NamedTuple):
    """Constants of one sequence at one number of samples a chip, in the layout of one path.

    The transform's result is a flat array of float32; the chip at delay k is found ``stride * positions[k]``
    numbers from its start, and once more every chip's width (2, 4, 8 numbers) until the next stride, where
    several captures share a row.
    """

    samples_per_chip: int
    stride: int
    gather: Array  # where the path finds the chips that make its rows
    positions: Array  # (chips,)
    rows: Array  # (chips,), Permutations.input
    delays: Array  # (chips,), Permutations.output
    polarity: float


class State(NamedTuple):
    """Work space and running sums of one thread."""

    capture: Array  # one or two captures, wrapped
    z: Array  # float32, the transform
    power: Array  # float32, sum of squares of z since the last flush
    power_total: Array  # float64
    samples: Array  # int32, sum of the captures since the last flush
    samples_total: Array  # float64


def new_state(numbers: int, capture: tuple[int, npt.DTypeLike], transform: int) -> State:
    """Allocate sums of ``numbers`` numbers a capture and ``transform`` numbers a transform, all zero."""
    return State(
        zeros(*capture),
        zeros(transform, np.float32),
        zeros(transform, np.float32),
        zeros(transform, np.float64),
        zeros(numbers, np.int32),
        zeros(numbers, np.float64),
    )


def zeros(size: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Allocate zeros that begin on a cache line, which vector loads and stores want."""
    kind = np.dtype(dtype)
    memory = np.zeros(size * kind.itemsize + LINE, np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size * kind.itemsize].view(kind)
