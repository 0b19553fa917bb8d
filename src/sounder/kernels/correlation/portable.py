"""The path for any processor: `hadamard` over rows that captures share.

A row of the transform has 16 numbers, a cache line, and room for ``16 // chip`` captures, where a chip is 2*spc numbers
(8 for spc = 3). A capture always takes the slot that its position in the whole recording gives it: each sum
is then made in the same order whatever blocks the recording arrives in, and the averages do not depend on the
blocks, to the last bit.
"""

from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import jit, part
from sounder.kernels.correlation import accumulate, hadamard
from sounder.kernels.correlation.hadamard import ROW
from sounder.kernels.correlation.permutations import Permutations
from sounder.kernels.correlation.tables import TAIL, Kernels, State, Tables, new_state

Array = Any


def tables(permutations: Permutations, samples_per_chip: int) -> Tables:
    """Lay out rows in natural order."""
    rows, delays = permutations.input, permutations.output
    chip = 8 if samples_per_chip > 2 else 2 * samples_per_chip
    none = np.empty(0, np.int64)
    chips = np.zeros(rows.size + 1, np.int64)
    chips[rows] = np.arange(rows.size)
    return Tables(samples_per_chip, chip, ROW, chips, delays, rows, delays, float(permutations.polarity), none)


def state(tables: Tables) -> State:
    """Allocate a thread's work space and sums."""
    chips = tables.rows.size
    numbers = 2 * chips * tables.samples_per_chip
    return new_state(0, numbers + TAIL, ROW // tables.chip * numbers, ROW * (chips + 1), numbers)


@part
def place(capture: Array, spc: int, sums: Array) -> None:
    """Sum a capture over chips."""
    for t in range(TAIL):
        capture[sums.size + t] = capture[t]
    hadamard.chip_sums(capture, spc, sums)


@part
def transform(tables: Tables, state: State) -> None:
    """Correlate the captures whose sums over chips are in the state."""
    hadamard.gather(state.sums, tables.gather, tables.samples_per_chip, tables.chip, state.z)
    hadamard.walsh_hadamard(state.z)


@part
def add_power(z: Array, power: Array) -> None:
    """Add the squares of z to the power."""
    for k in range(z.size):
        power[k] += z[k] * z[k]


@jit
def add_int16(x: Array, before: int, tables: Tables, state: State) -> None:
    """Add captures (capture, number), flat I/Q, to the sums, which hold ``before`` captures; with 0, begin anew."""
    spc, capture, sums = tables.samples_per_chip, state.capture, state.sums
    slots, numbers = ROW // tables.chip, x.shape[1]
    sums[:] = 0
    if before == 0:
        accumulate.clear(state.power, state.power_total)
        accumulate.clear(state.samples, state.samples_total)
    for i in range(x.shape[0]):
        one, samples = x[i], state.samples
        for t in range(one.size):
            capture[t] = np.float32(one[t])
        for t in range(one.size):
            samples[t] += np.int32(one[t])
        slot = (before + i) % slots
        place(capture, spc, sums[slot * numbers : (slot + 1) * numbers])
        count, left = before + i + 1, x.shape[0] - i - 1
        if count % slots == 0 or left == 0:
            transform(tables, state)
            add_power(state.z, state.power)
            if left < slots:
                sums[:] = 0
        if count % accumulate.FLUSH_POWER == 0:
            accumulate.flush(state.power, state.power_total)
        if count % accumulate.FLUSH_SAMPLES == 0:
            accumulate.flush(state.samples, state.samples_total)


@jit
def add_float32(x: Array, before: int, tables: Tables, state: State) -> None:
    """Like `add_int16`, of single-precision captures."""
    spc, capture, sums = tables.samples_per_chip, state.capture, state.sums
    slots, numbers = ROW // tables.chip, x.shape[1]
    sums[:] = 0
    if before == 0:
        accumulate.clear(state.power, state.power_total)
        accumulate.clear(state.samples, state.samples_total)
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            capture[t] = x[i, t]
            state.samples_total[t] += x[i, t]
        slot = (before + i) % slots
        place(capture, spc, sums[slot * numbers : (slot + 1) * numbers])
        count, left = before + i + 1, x.shape[0] - i - 1
        if count % slots == 0 or left == 0:
            transform(tables, state)
            add_power(state.z, state.power)
            if left < slots:
                sums[:] = 0
        if count % accumulate.FLUSH_POWER == 0:
            accumulate.flush(state.power, state.power_total)


@jit
def means(count: int, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    """Write the mean correlation, flat I/Q (number,), and the mean power (sample,) of ``count`` captures."""
    spc, positions = tables.samples_per_chip, tables.positions
    accumulate.mean_power(state.power, state.power_total, count, spc, tables.chip, tables.stride, positions, power)
    accumulate.mean_capture(state.samples, state.samples_total, count, state.capture)
    state.sums[:] = 0
    place(state.capture, spc, state.sums[: correlation.size])
    transform(tables, state)
    hadamard.unpermute(state.z, ROW, positions, spc, tables.polarity, correlation)


@jit
def correlate_float32(x: Array, tables: Tables, state: State, out: Array) -> None:
    """Correlate every capture (capture, number), flat I/Q in and out."""
    spc = tables.samples_per_chip
    state.sums[:] = 0
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            state.capture[t] = x[i, t]
        place(state.capture, spc, state.sums[: x.shape[1]])
        transform(tables, state)
        hadamard.unpermute(state.z, ROW, tables.positions, spc, tables.polarity, out[i])


def kernels(_order: int, _samples_per_chip: int) -> Kernels:
    """Give the entry points, the same for any sequence."""
    return Kernels(add_int16, add_float32, means, correlate_float32)
