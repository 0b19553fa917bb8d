"""The path for processors with AVX-512: the transform of `hadamard` in registers.

One capture at a time. A row, a register of 16 numbers, holds the chips of ``16 // chip`` Walsh indices ``v =
row + rows * lane``, so that butterflies over the low bits of v are sums of rows, and those over the last bits
sums of lanes. Three kinds of pass over the rows, of 8 or 16 each:

1. gather the chips by the permutation, straight from the (int16) samples, and transform the highest row bits;
2. transform middle bits, block by block, so that a block stays in the nearest cache (orders 10 and up);
3. transform the lowest three bits and, after transposing chips between rows, the lanes; square and add.

Captures of 2 samples per chip are copied two at a time to a place where their beginning is repeated behind
their end, and summed on the way; while one is transformed, the one `AHEAD` bytes later is fetched.
"""

from functools import cache
from typing import Any

import numpy as np

from sounder.kernels.compiler.compile import jit, part_with_literals
from sounder.kernels.correlation import accumulate, avx512_instructions, hadamard
from sounder.kernels.correlation.permutations import Permutations
from sounder.kernels.correlation.tables import LINE, TAIL, Kernels, State, Tables, new_state

AHEAD = 1 << 15
"""Bytes from a capture to the one that is fetched meanwhile; chosen, not derived."""
ORDERS = range(9, 16)
"""Orders that fill the registers of the passes; shorter sequences go the portable path."""
LAST = 8
"""Rows of the last pass."""
GAP = 4
"""Chips behind the last that may be gathered: what is wrapped, and zeros."""

Array = Any


def tables(permutations: Permutations, samples_per_chip: int) -> Tables:
    """Lay out rows as the passes want them."""
    chips = permutations.input.size
    chip = 8 if samples_per_chip > 2 else 2 * samples_per_chip
    lanes = avx512_instructions.LANES // chip
    rows = (chips + 1) // lanes
    radix = avx512_instructions.FIRST_RADIX[chip]

    chip_of = np.full(chips + 1, chips + GAP - 2)  # index 0: a chip of zeros
    chip_of[permutations.input] = np.arange(chips)
    j, i, lane = np.ogrid[: rows // radix, :radix, :lanes]
    gather = 4 * samples_per_chip * chip_of[j + rows // radix * i + rows * lane]

    block, k, i = np.ogrid[: rows // lanes, :lanes, :lanes]
    position_of = np.empty(chips + 1, np.int64)
    position_of[(lanes * block + i + rows * k).ravel()] = np.arange(chips + 1)
    return Tables(
        samples_per_chip,
        chip,
        chip,
        gather.astype(np.uint32).ravel(),
        position_of[permutations.output],
        permutations.input,
        permutations.output,
        float(permutations.polarity),
        avx512_instructions.sum_order(np.arange(2 * samples_per_chip * (chips + 1))),
    )


def state(tables: Tables) -> State:
    """Allocate a thread's work space and sums."""
    spc, chips = tables.samples_per_chip, tables.rows.size
    staged = 2 * _staged_size(chips) if spc == 2 else 0
    capture = 2 * spc * chips + TAIL
    return new_state(staged, capture, 2 * spc * (chips + GAP), tables.chip * (chips + 1), 2 * spc * (chips + 1))


def _staged_size(chips: int) -> int:
    """Numbers from one staged capture to the next: a multiple of a cache line, not of a page."""
    return 4 * (chips + 1) + 64


upper_radix = part_with_literals(avx512_instructions.upper_radix)


@part_with_literals
def middle_passes(rows: int, z: int) -> None:
    """Transform a block of rows down to groups of 8 neighbours."""
    upper = upper_radix(rows)
    if upper > 1:
        for row in range(rows // upper):
            avx512_instructions.upper_rows(rows, z + LINE * row)
    if upper * LAST < rows:
        for start in range(0, rows, rows // upper):
            for row in range(start, start + LAST):
                avx512_instructions.lower_rows(rows, z + LINE * row)


@part_with_literals
def transform_sums(chip: int, rows: int, spc: int, capture: Array, sums: Array, gather: Array, z: Array) -> None:
    """Sum the capture over chips and do the first pass, to blocks of ``rows`` rows."""
    numbers = capture.size - TAIL
    for t in range(TAIL):
        capture[numbers + t] = capture[t]
    hadamard.chip_sums(capture, spc, sums[:numbers])
    step = 4 * gather.size // rows
    for row in range(rows):
        chips = gather.ctypes.data + step * row
        avx512_instructions.gather_chips(chip, rows, sums.ctypes.data, chips, z.ctypes.data + LINE * row)


@part_with_literals
def finish_transform(chip: int, rows: int, z: Array) -> None:
    """Do the passes after the first, in place."""
    for block in range(0, z.size // avx512_instructions.LANES, rows):
        middle_passes(rows, z.ctypes.data + LINE * block)
        for row in range(block, block + rows, LAST):
            avx512_instructions.last_rows(chip, z.ctypes.data + LINE * row)


@part_with_literals
def finish_power(chip: int, rows: int, z: Array, power: Array) -> None:
    """Do the passes after the first and add the squares of the result to the power."""
    for block in range(0, z.size // avx512_instructions.LANES, rows):
        middle_passes(rows, z.ctypes.data + LINE * block)
        for row in range(block, block + rows, LAST):
            avx512_instructions.last_rows_power(chip, z.ctypes.data + LINE * row, power.ctypes.data + LINE * row)


@part_with_literals
def stage_two(x: int, numbers: int, staged: Array, samples: Array) -> None:
    """Copy the two captures at address x, wrapped, and add them to the sums."""
    size = 2 * numbers
    target, next_target = staged.ctypes.data, staged.ctypes.data + staged.size
    sums = samples.ctypes.data
    for place in range(0, size - LINE, LINE):
        avx512_instructions.copy_two(x + place, x + size + place, target + place, next_target + place, sums + 2 * place)
    place = size - 56
    avx512_instructions.copy_two_ends(
        x + place, x + size + place, target + place, next_target + place, sums + 2 * place
    )
    wrap_two(numbers, staged)


@part_with_literals
def wrap_two(numbers: int, staged: Array) -> None:
    """Repeat the beginning of the staged captures behind their ends."""
    half = staged.size // 2
    for t in range(4):
        staged[numbers + t] = staged[t]
        staged[half + numbers + t] = staged[half + t]


@part_with_literals
def stage_one(x: Array, staged: Array, samples_total: Array) -> None:
    """Copy one capture, wrapped, and add it to the sums."""
    for t in range(x.size):
        staged[t] = x[t]
        samples_total[t] += x[t]
    wrap_two(x.size, staged)


@part_with_literals
def add_staged(rows: int, ahead: int, staged: int, gather: int, z: Array, power: Array) -> None:
    """Transform one staged capture, add its power, and fetch the capture at address ``ahead``."""
    for row in range(rows):
        avx512_instructions.gather_samples(rows, staged, gather + 256 * row, z.ctypes.data + LINE * row)
        for _ in range(4):
            avx512_instructions.prefetch(ahead)
            ahead += LINE
    for block in range(0, 16 * rows, rows):
        middle_passes(rows, z.ctypes.data + LINE * block)
        for row in range(block, block + rows, LAST):
            avx512_instructions.last_rows_power(4, z.ctypes.data + LINE * row, power.ctypes.data + LINE * row)
            for _ in range(2):
                avx512_instructions.prefetch(ahead)
                ahead += LINE


@cache
def kernels(order: int, samples_per_chip: int) -> Kernels:
    """Make the entry points for an order and a number of samples per chip.

    They are closed over two constants alone: the numbers of a chip, and the rows of a block after the first
    pass.
    """
    chip = 8 if samples_per_chip > 2 else 2 * samples_per_chip
    rows = (1 << order) * chip // avx512_instructions.LANES // avx512_instructions.FIRST_RADIX[chip]

    def add_pairs(x: Array, before: int, tables: Tables, state: State) -> None:
        numbers = x.shape[1]
        half = state.staged.size  # bytes
        if before == 0:
            accumulate.clear(state.power, state.power_total)
            accumulate.clear(state.samples, state.samples_total)
        for i in range(0, x.shape[0], 2):
            together = 2 if i + 1 < x.shape[0] else 1
            address = x.ctypes.data + 2 * numbers * i
            if together == 2:
                stage_two(address, numbers, state.staged, state.samples)
            else:
                stage_one(x[i], state.staged, state.samples_total)
            for c in range(together):
                ahead, staged = address + 2 * numbers * c + AHEAD, state.staged.ctypes.data + half * c
                add_staged(rows, ahead, staged, tables.gather.ctypes.data, state.z, state.power)
                if (before + i + c + 1) % accumulate.FLUSH_POWER == 0:
                    accumulate.flush(state.power, state.power_total)
            if (i + 2) % accumulate.FLUSH_SAMPLES == 0:
                accumulate.flush_permuted(state.samples, tables.number_order, state.samples_total)
        accumulate.flush_permuted(state.samples, tables.number_order, state.samples_total)

    def add_int16(x: Array, before: int, tables: Tables, state: State) -> None:
        if before == 0:
            accumulate.clear(state.power, state.power_total)
            accumulate.clear(state.samples, state.samples_total)
        for i in range(x.shape[0]):
            for t in range(x.shape[1]):
                state.capture[t] = np.float32(x[i, t])
                state.samples[t] = np.int32(state.samples[t] + np.int32(x[i, t]))
            transform_sums(chip, rows, tables.samples_per_chip, state.capture, state.sums, tables.gather, state.z)
            finish_power(chip, rows, state.z, state.power)
            if (before + i + 1) % accumulate.FLUSH_POWER == 0:
                accumulate.flush(state.power, state.power_total)
            if (before + i + 1) % accumulate.FLUSH_SAMPLES == 0:
                accumulate.flush(state.samples, state.samples_total)

    def add_float32(x: Array, before: int, tables: Tables, state: State) -> None:
        if before == 0:
            accumulate.clear(state.power, state.power_total)
            accumulate.clear(state.samples, state.samples_total)
        for i in range(x.shape[0]):
            for t in range(x.shape[1]):
                state.capture[t] = x[i, t]
                state.samples_total[t] += x[i, t]
            transform_sums(chip, rows, tables.samples_per_chip, state.capture, state.sums, tables.gather, state.z)
            finish_power(chip, rows, state.z, state.power)
            if (before + i + 1) % accumulate.FLUSH_POWER == 0:
                accumulate.flush(state.power, state.power_total)

    def means(count: int, tables: Tables, state: State, correlation: Array, power: Array) -> None:
        spc, stride, positions = tables.samples_per_chip, tables.stride, tables.positions
        accumulate.mean_power(state.power, state.power_total, count, spc, tables.chip, stride, positions, power)
        accumulate.mean_capture(state.samples, state.samples_total, count, state.capture)
        transform_sums(chip, rows, spc, state.capture, state.sums, tables.gather, state.z)
        finish_transform(chip, rows, state.z)
        hadamard.unpermute(state.z, chip, positions, spc, tables.polarity, correlation)

    def correlate_float32(x: Array, tables: Tables, state: State, out: Array) -> None:
        spc, positions = tables.samples_per_chip, tables.positions
        for i in range(x.shape[0]):
            for t in range(x.shape[1]):
                state.capture[t] = x[i, t]
            transform_sums(chip, rows, tables.samples_per_chip, state.capture, state.sums, tables.gather, state.z)
            finish_transform(chip, rows, state.z)
            hadamard.unpermute(state.z, chip, positions, spc, tables.polarity, out[i])

    int16 = add_pairs if samples_per_chip == 2 else add_int16
    # Kernels of different constants must not share a cache file (see `sounder.kernels.compiler.cache`).
    for kernel in (int16, add_float32, means, correlate_float32):
        kernel.__qualname__ = f"{kernel.__name__}_{order}_{chip}"
    return Kernels(jit(int16), jit(add_float32), jit(means), jit(correlate_float32))
