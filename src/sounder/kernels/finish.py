"""From sums over snapshots to the averages, with the transform of the coherent mean in float64."""

from typing import Any

import numpy as np

from sounder.kernels.compile import jit, part
from sounder.kernels.hadamard import scatter, walsh_hadamard, wrap
from sounder.kernels.tables import State, Tables

Array = Any

# Equal captures round alike: n additions of one float32 number are off by at most n/8 of its last bits, 5e-7
# for 32.
FLUSH_POWER = 32
# int16 fits int32 65535 times.
FLUSH_SAMPLES = 1 << 14


@part
def flush(partial: Array, total: Array) -> None:
    """Move a low-precision partial sum into its float64 total."""
    for k in range(partial.size):
        total[k] += partial[k]
        partial[k] = 0


@part
def add_int16(x: Array, seen: int, partial: Array, total: Array) -> None:
    """Add captures to the coherent sum, exactly: int32, moved to float64 before it can overflow."""
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            partial[t] = np.int32(partial[t] + np.int32(x[i, t]))
        if (seen + i + 1) % FLUSH_SAMPLES == 0:
            flush(partial, total)


@part
def add_float32(x: Array, total: Array) -> None:
    """Add captures to the coherent sum in float64."""
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            total[t] += x[i, t]


@part
def transform(samples: Array, scale: float, spc: int, rows: Array, delays: Array, out: Array) -> None:
    """Correlate one vector of flat I/Q numbers in float64."""
    chip = 2 * spc
    e = np.empty(samples.size + 8)
    for t in range(samples.size):
        e[t] = scale * samples[t]
    wrap(e, samples.size)
    z = np.zeros((rows.size + 1) * chip)
    scatter(e, rows, spc, chip, 0, z)
    walsh_hadamard(z, chip)
    for k in range(delays.size):
        for c in range(chip):
            out[chip * k + c] = z[chip * delays[k] + c]


@part
def mean_power(state: State, tables: Tables, count: int, out: Array) -> None:
    """Mean of |correlation|**2: sum I and Q, and the captures that share a row."""
    spc = tables.samples_per_chip
    chip = 8 if spc > 2 else 2 * spc
    for k in range(tables.positions.size):
        first = tables.stride * tables.positions[k]
        for c in range(spc):
            value = 0.0
            for p in range(first + 2 * c, first + tables.stride, chip):
                value += (state.power_total[p] + state.power[p]) + (
                    state.power_total[p + 1] + state.power[p + 1]
                )
            out[spc * k + c] = value / count


@part
def means(state: State, tables: Tables, count: int, correlation: Array, power: Array) -> None:
    """Write the averages of the ``count`` captures that the state has seen: flat I/Q, and power."""
    mean_power(state, tables, count, power)
    samples = state.samples_total + state.samples
    scale = tables.polarity / count
    transform(samples, scale, tables.samples_per_chip, tables.rows, tables.delays, correlation)


@part
def clear(state: State) -> None:
    """Forget all captures."""
    state.power[:] = 0
    state.power_total[:] = 0
    state.samples[:] = 0
    state.samples_total[:] = 0


@jit
def result(state: State, tables: Tables, count: int, correlation: Array, power: Array) -> None:
    """Entry point of `means`."""
    means(state, tables, count, correlation, power)


@jit
def correlate_one(samples: Array, tables: Tables, out: Array) -> None:
    """Entry point of `transform`."""
    transform(samples, tables.polarity, tables.samples_per_chip, tables.rows, tables.delays, out)
