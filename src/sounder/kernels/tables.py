"""What a compiled correlator is given: its constant tables, and the sums it works on."""

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


class State(NamedTuple):
    """Work space and running sums of one thread."""

    capture: Array  # as the path wants it, its beginning repeated behind its end
    sums: Array  # float32, sums over the samples of a chip
    z: Array  # float32, the transform
    power: Array  # float32, sum of squares of z since the last flush
    power_total: Array  # float64
    samples: Array  # int32, sum of the captures since the last flush
    samples_total: Array  # float64


def new_state(tables: Tables, capture: tuple[int, npt.DTypeLike], transform: int) -> State:
    """Allocate a state of ``transform`` numbers a transform, all sums zero."""
    numbers = 2 * tables.samples_per_chip * tables.rows.size
    return State(
        zeros(*capture),
        zeros(numbers, np.float32),
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
