"""The portable path: `hadamard` over rows that captures share.

A row of z has 16 numbers, a cache line, and room for ``16 // chip`` captures, where a chip is 2*spc numbers
(padded to 8 for spc = 3). A capture always takes the slot that its position in the whole recording gives it:
each sum is then made in the same order whatever blocks the recording arrives in, and the averages do not
depend on the blocks, to the last bit.
"""

from typing import Any

import numpy as np

from sounder.kernels import finish, hadamard
from sounder.kernels.compile import jit, part
from sounder.kernels.mls import Permutations
from sounder.kernels.tables import State, Tables, new_state

ROW = 16

Array = Any


def tables(permutations: Permutations, samples_per_chip: int) -> Tables:
    """Lay out rows in natural order."""
    rows, delays = permutations.input, permutations.output
    return Tables(samples_per_chip, ROW, rows, delays, rows, delays, float(permutations.polarity))


def state(chips: int, samples_per_chip: int) -> State:
    """Allocate a thread's work space and sums."""
    numbers = 2 * chips * samples_per_chip
    return new_state(numbers, (numbers + 8, np.float32), ROW * (chips + 1))


@part
def _transform(x: Array, slot: int, tables: Tables, state: State) -> None:
    """Transform the captures x side by side in one row, the first of them in the given slot."""
    spc = tables.samples_per_chip
    chip = 8 if spc > 2 else 2 * spc
    e, z = state.capture, state.z
    full = spc != 3 and x.shape[0] * chip == ROW
    z[: ROW if full else z.size] = 0  # else every row but the first is overwritten
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            e[t] = np.float32(x[i, t])
        hadamard.wrap(e, x.shape[1])
        hadamard.scatter(e, tables.rows, spc, ROW, (slot + i) * chip, z)
    hadamard.walsh_hadamard(z, ROW)


@part
def _add_power(x: Array, seen: int, tables: Tables, state: State) -> None:
    slots = ROW // (8 if tables.samples_per_chip > 2 else 2 * tables.samples_per_chip)
    first = 0
    while first < x.shape[0]:
        slot = (seen + first) % slots
        last = min(x.shape[0], first + slots - slot)
        _transform(x[first:last], slot, tables, state)
        for k in range(state.z.size):
            state.power[k] += state.z[k] * state.z[k]
        first = last
        if (seen + first) % finish.FLUSH_POWER == 0:
            finish.flush(state.power, state.power_total)


@part
def _add_int16(x: Array, seen: int, tables: Tables, state: State) -> None:
    finish.add_int16(x, seen, state.samples, state.samples_total)
    _add_power(x, seen, tables, state)


@part
def _add_float32(x: Array, seen: int, tables: Tables, state: State) -> None:
    finish.add_float32(x, state.samples_total)
    _add_power(x, seen, tables, state)


@part
def _correlate(x: Array, tables: Tables, state: State, out: Array) -> None:
    for i in range(x.shape[0]):
        _transform(x[i : i + 1], 0, tables, state)
        spc = tables.samples_per_chip
        hadamard.unpermute(state.z, tables.stride, 0, tables.positions, spc, tables.polarity, out[i])


@jit
def add_int16(x: Array, seen: int, tables: Tables, state: State) -> None:
    """Add captures (capture, number), flat I/Q, to the sums; ``seen`` captures went before."""
    _add_int16(x, seen, tables, state)


@jit
def add_float32(x: Array, seen: int, tables: Tables, state: State) -> None:
    """Like `add_int16`, of single-precision captures."""
    _add_float32(x, seen, tables, state)


@jit
def average_int16(x: Array, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    """Average captures (direction, capture, number) over captures."""
    for d in range(x.shape[0]):
        finish.clear(state)
        _add_int16(x[d], 0, tables, state)
        finish.means(state, tables, x.shape[1], correlation[d], power[d])


@jit
def average_float32(x: Array, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    """Like `average_int16`, of single-precision captures."""
    for d in range(x.shape[0]):
        finish.clear(state)
        _add_float32(x[d], 0, tables, state)
        finish.means(state, tables, x.shape[1], correlation[d], power[d])


@jit
def correlate_int16(x: Array, tables: Tables, state: State, out: Array) -> None:
    """Correlate every capture (capture, number), flat I/Q in and out."""
    _correlate(x, tables, state, out)


@jit
def correlate_float32(x: Array, tables: Tables, state: State, out: Array) -> None:
    """Like `correlate_int16`, of single-precision captures."""
    _correlate(x, tables, state, out)
