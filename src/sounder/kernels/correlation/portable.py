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
    return Tables(samples_per_chip, chip, ROW, rows, delays, rows, delays, float(permutations.polarity), none)


def state(tables: Tables) -> State:
    """Allocate a thread's work space and sums."""
    chips = tables.rows.size
    numbers = 2 * chips * tables.samples_per_chip
    return new_state(0, numbers + TAIL, numbers, ROW * (chips + 1), numbers)


@part
def place(capture: Array, sums: Array, spc: int, rows: Array, first: int, z: Array) -> None:
    """Sum a capture over chips, and write chip n to row ``rows[n]`` of z from complex number ``first`` on."""
    for t in range(TAIL):
        capture[sums.size + t] = capture[t]
    hadamard.chip_sums(capture, spc, sums)
    hadamard.scatter(sums.view(np.complex64), rows, spc, ROW // 2, first, z.view(np.complex64))


@part
def add_power(z: Array, power: Array) -> None:
    """Add the squares of z to the power, and empty z."""
    for k in range(z.size):
        power[k] += z[k] * z[k]
        z[k] = 0


@jit
def add_int16(x: Array, before: int, tables: Tables, state: State) -> None:
    """Add captures (capture, number), flat I/Q, to the sums, which hold ``before`` captures; with 0, begin anew."""
    spc, chip, rows, capture, z = tables.samples_per_chip, tables.chip, tables.rows, state.capture, state.z
    slots = ROW // chip
    if before == 0:
        accumulate.clear(state.power, state.power_total)
        accumulate.clear(state.samples, state.samples_total)
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            capture[t] = np.float32(x[i, t])
            state.samples[t] = np.int32(state.samples[t] + np.int32(x[i, t]))
        place(capture, state.sums, spc, rows, (before + i) % slots * chip // 2, z)
        count = before + i + 1
        if count % slots == 0 or i + 1 == x.shape[0]:
            hadamard.walsh_hadamard(z)
            add_power(z, state.power)
        if count % accumulate.FLUSH_POWER == 0:
            accumulate.flush(state.power, state.power_total)
        if count % accumulate.FLUSH_SAMPLES == 0:
            accumulate.flush(state.samples, state.samples_total)


@jit
def add_float32(x: Array, before: int, tables: Tables, state: State) -> None:
    """Like `add_int16`, of single-precision captures."""
    spc, chip, rows, capture, z = tables.samples_per_chip, tables.chip, tables.rows, state.capture, state.z
    slots = ROW // chip
    if before == 0:
        accumulate.clear(state.power, state.power_total)
        accumulate.clear(state.samples, state.samples_total)
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            capture[t] = x[i, t]
            state.samples_total[t] += x[i, t]
        place(capture, state.sums, spc, rows, (before + i) % slots * chip // 2, z)
        count = before + i + 1
        if count % slots == 0 or i + 1 == x.shape[0]:
            hadamard.walsh_hadamard(z)
            add_power(z, state.power)
        if count % accumulate.FLUSH_POWER == 0:
            accumulate.flush(state.power, state.power_total)


@jit
def means(count: int, tables: Tables, state: State, correlation: Array, power: Array) -> None:
    """Write the mean correlation, flat I/Q (number,), and the mean power (sample,) of ``count`` captures."""
    spc, positions, z = tables.samples_per_chip, tables.positions, state.z
    accumulate.mean_power(state.power, state.power_total, count, spc, tables.chip, tables.stride, positions, power)
    accumulate.mean_capture(state.samples, state.samples_total, count, state.capture)
    place(state.capture, state.sums, spc, tables.rows, 0, z)
    hadamard.walsh_hadamard(z)
    hadamard.unpermute(z, ROW, positions, spc, tables.polarity, correlation)
    z[:] = 0


@jit
def correlate_float32(x: Array, tables: Tables, state: State, out: Array) -> None:
    """Correlate every capture (capture, number), flat I/Q in and out."""
    spc, z = tables.samples_per_chip, state.z
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            state.capture[t] = x[i, t]
        place(state.capture, state.sums, spc, tables.rows, 0, z)
        hadamard.walsh_hadamard(z)
        hadamard.unpermute(z, ROW, tables.positions, spc, tables.polarity, out[i])
        z[:] = 0


def kernels(_order: int, _samples_per_chip: int) -> Kernels:
    """Give the entry points, the same for any sequence."""
    return Kernels(add_int16, add_float32, means, correlate_float32)
