"""What a compiled correlator is given: its constant tables, and the sums it works on."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

LINE = 64
TAIL = 8  # numbers that the sums of the last chip reach beyond the end

Array = Any


class Tables(NamedTuple):
    """Constants of one sequence at one number of samples a chip, in the layout of one path.

    The transform is a flat array of float32. The chip of delay k begins ``stride * positions[k]`` numbers
    from its start; where several captures share a stride, each has ``chip`` numbers of it.
    """

    samples_per_chip: int
    chip: int
    stride: int
    gather: Array  # where the path finds the chips of its rows
    positions: Array  # (chips,)
    rows: Array  # (chips,), Permutations.input
    delays: Array  # (chips,), Permutations.output
    polarity: float
    number_order: Array  # number of a capture that is summed at each position of State.samples, where permuted


class Path(NamedTuple):
    """Entry points."""

    run_int16: Callable[..., None]
    run_float32: Callable[..., None]
    correlate_float32: Callable[..., None]


class State(NamedTuple):
    """Work space and running sums of one thread."""

    staged: Array  # int16, two captures, wrapped
    capture: Array  # float32, one capture, wrapped
    sums: Array  # float32, sums over the samples of a chip
    z: Array  # float32, the transform; where captures share rows, zero between calls
    power: Array  # float32, sum of squares of z since the last flush
    power_total: Array  # float64
    samples: Array  # int32, sum of the captures since the last flush
    samples_total: Array  # float64


def new_state(staged: int, capture: int, sums: int, transform: int, samples: int) -> State:
    """Allocate a state of these sizes, all sums zero."""
    return State(
        zeros(staged, np.int16),
        zeros(capture, np.float32),
        zeros(sums, np.float32),
        zeros(transform, np.float32),
        zeros(transform, np.float32),
        zeros(transform, np.float64),
        zeros(samples, np.int32),
        zeros(samples, np.float64),
    )


def zeros(size: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Allocate zeros that begin on a cache line, which vector loads and stores want."""
    kind = np.dtype(dtype)
    memory = np.zeros(size * kind.itemsize + LINE, np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size * kind.itemsize].view(kind)
