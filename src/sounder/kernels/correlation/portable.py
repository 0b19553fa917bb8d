"""The portable path: `hadamard` over rows that captures share.

A row of z has 16 numbers, a cache line, and room for ``16 // chip`` captures, where a chip is 2*spc numbers
(8 for spc = 3). A capture always takes the slot that its position in the whole recording gives it: each sum
is then made in the same order whatever blocks the recording arrives in, and the averages do not depend on the
blocks, to the last bit.
"""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import jit, part
from sounder.kernels.correlation import accumulate, hadamard
from sounder.kernels.correlation.permutations import Permutations
from sounder.kernels.correlation.tables import TAIL, Path, State, Tables, new_state

ROW = 16

Array = Any


def tables(permutations: Permutations, samples_per_chip: int) -> Tables:
    """Lay out rows in natural order."""
    rows, delays = permutations.input, permutations.output
    chip = 8 if samples_per_chip > 2 else 2 * samples_per_chip
    none = np.empty(0, np.int64)
    return Tables(samples_per_chip, chip, ROW, rows, delays, rows, delays, float(permutations.polarity), none)


def state(tables: Tables) -> State:
    """Allocate a thread's work space and sums."""
    chips = tables.rows.size
    numbers = 2 * chips * tables.samples_per_chip
    return new_state(0, numbers + TAIL, numbers, ROW * (chips + 1), numbers)


@part
def place(e: Array, u: Array, slot: int, tables: Tables, z: Array) -> None:
    """Sum a capture over chips and write them into a slot of their rows."""
    for t in range(TAIL):
        e[u.size + t] = e[t]
    spc = tables.samples_per_chip
    hadamard.chip_sums(e, spc, u)
    first = slot * tables.chip // 2
    hadamard.scatter(u.view(np.complex64), tables.rows, spc, ROW // 2, first, z.view(np.complex64))


@part
def add_power(z: Array, power: Array) -> None:
    """Add z**2 to the power and empty z."""
    for k in range(z.size):
        power[k] += z[k] * z[k]
        z[k] = 0


@part
def _means(count: int, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    spc, positions = tables.samples_per_chip, tables.positions
    accumulate.mean_power(state.power, state.power_total, count, spc, tables.chip, tables.stride, positions, power)
    accumulate.mean_capture(state.samples, state.samples_total, count, state.capture)
    place(state.capture, state.sums, 0, tables, state.z)
    hadamard.walsh_hadamard(state.z, ROW)
    hadamard.unpermute(state.z, ROW, positions, spc, tables.polarity, correlation)
    for k in range(state.z.size):
        state.z[k] = 0


@jit
def run_int16(x: Array, seen: int, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    """Add captures (direction, capture, number), flat I/Q, to the sums; write averages where there is room.

    With ``seen`` zero, every direction begins anew; else ``seen`` captures were added before. The averages of
    a direction are written if ``correlation``, flat I/Q (direction, number), and ``power`` have a row for
    it.
    """
    slots = ROW // tables.chip
    for d in range(x.shape[0]):
        if seen == 0:
            accumulate.clear(state.power, state.power_total)
            accumulate.clear(state.samples, state.samples_total)
        for i in range(x.shape[1]):
            for t in range(x.shape[2]):
                state.capture[t] = np.float32(x[d, i, t])
                state.samples[t] = np.int32(state.samples[t] + np.int32(x[d, i, t]))
            place(state.capture, state.sums, (seen + i) % slots, tables, state.z)
            count = seen + i + 1
            if count % slots == 0 or i + 1 == x.shape[1]:
                hadamard.walsh_hadamard(state.z, ROW)
                add_power(state.z, state.power)
            if count % accumulate.FLUSH_POWER == 0:
                accumulate.flush(state.power, state.power_total)
            if count % accumulate.FLUSH_SAMPLES == 0:
                accumulate.flush(state.samples, state.samples_total)
        if d < correlation.shape[0]:
            _means(seen + x.shape[1], tables, state, correlation[d], power[d])


@jit
def run_float32(x: Array, seen: int, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    """Like `run_int16`, of single-precision captures."""
    slots = ROW // tables.chip
    for d in range(x.shape[0]):
        if seen == 0:
            accumulate.clear(state.power, state.power_total)
            accumulate.clear(state.samples, state.samples_total)
        for i in range(x.shape[1]):
            for t in range(x.shape[2]):
                state.capture[t] = x[d, i, t]
                state.samples_total[t] += x[d, i, t]
            place(state.capture, state.sums, (seen + i) % slots, tables, state.z)
            count = seen + i + 1
            if count % slots == 0 or i + 1 == x.shape[1]:
                hadamard.walsh_hadamard(state.z, ROW)
                add_power(state.z, state.power)
            if count % accumulate.FLUSH_POWER == 0:
                accumulate.flush(state.power, state.power_total)
            if count % accumulate.FLUSH_SAMPLES == 0:
                accumulate.flush(state.samples, state.samples_total)
        if d < correlation.shape[0]:
            _means(seen + x.shape[1], tables, state, correlation[d], power[d])


@jit
def correlate_float32(x: Array, tables: Tables, state: State, out: Array) -> None:
    """Correlate every capture (capture, number), flat I/Q in and out."""
    spc = tables.samples_per_chip
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            state.capture[t] = x[i, t]
        place(state.capture, state.sums, 0, tables, state.z)
        hadamard.walsh_hadamard(state.z, ROW)
        hadamard.unpermute(state.z, ROW, tables.positions, spc, tables.polarity, out[i])
        for k in range(state.z.size):
            state.z[k] = 0


def path(_order: int, _samples_per_chip: int) -> Path:
    """Give the entry points, the same for any sequence."""
    return Path(run_int16, run_float32, correlate_float32)
