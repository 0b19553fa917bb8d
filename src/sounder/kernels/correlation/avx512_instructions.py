"""Vector instructions, as functions for compiled code; only this file writes LLVM.

All work on vectors of 16 numbers, 64 bytes, an AVX-512 register, and take addresses. A ``row`` is such a
vector; `avx512` says what the rows mean. `available` tells whether numba compiles for a processor that has them.
"""

import os
from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from sounder.kernels.correlation.tables import LINE

LANES = LINE // 4
"""Numbers of a register: float32 or int32."""
I8, I16, I32, I64, F32 = ir.IntType(8), ir.IntType(16), ir.IntType(32), ir.IntType(64), ir.FloatType()
FLOATS = ir.VectorType(F32, LANES)
SHORTS = ir.VectorType(I16, 2 * LANES)
FUSED = ("contract",)
"""Sums and products may be rounded once, in one instruction."""
FIRST_RADIX = {2: 8, 4: 16, 8: 16}
"""Rows of the first pass, by numbers per chip; the smallest order has no more."""
NEEDED = ("avx512f", "avx512bw", "avx512dq", "avx512vl")
"""Features of the target without which LLVM does not know the instructions here."""

Builder = Any
Value = Any


def available() -> bool:
    """Tell whether numba compiles for AVX-512 and ``SOUNDER_PORTABLE_KERNELS`` does not forbid to use it.

    What counts is the target, not this machine: ``NUMBA_CPU_NAME=generic`` and ``NUMBA_ENABLE_AVX=0`` have none.
    """
    if numba.config.DISABLE_JIT or os.environ.get("SOUNDER_PORTABLE_KERNELS", "0") not in ("", "0"):
        return False
    _triple, _name, features = cpu_target.target_context.codegen().magic_tuple()
    return {f"+{name}" for name in NEEDED} <= set(features.split(","))


def _int(value: int) -> Value:
    return ir.Constant(I64, value)


def load(b: Builder, address: Value, offset: int, kind: Any, align: int) -> Value:
    """Load a vector from an address plus a number of bytes."""
    loaded = b.load(b.inttoptr(b.add(address, _int(offset)), kind.as_pointer()))
    loaded.align = align
    return loaded


def store(b: Builder, value: Value, address: Value, offset: int, align: int = LINE) -> None:
    """Store a vector to an address plus a number of bytes."""
    stored = b.store(value, b.inttoptr(b.add(address, _int(offset)), value.type.as_pointer()))
    stored.align = align


def shuffle(b: Builder, x: Value, y: Value, lanes: Sequence[int]) -> Value:
    """Choose numbers of two vectors, counted through both."""
    mask = ir.Constant(ir.VectorType(I32, len(lanes)), [ir.Constant(I32, lane) for lane in lanes])
    return b.shuffle_vector(x, y, mask)


def _join(b: Builder, parts: Sequence[Value]) -> Value:
    """Put vectors behind one another."""
    while len(parts) > 1:
        width = range(2 * parts[0].type.count)
        parts = [shuffle(b, x, y, width) for x, y in zip(parts[::2], parts[1::2], strict=True)]
    return parts[0]


def add(b: Builder, x: Value, y: Value) -> Value:
    """Add vectors of floats or of integers."""
    return b.fadd(x, y, flags=FUSED) if x.type == FLOATS else b.add(x, y)


def subtract(b: Builder, x: Value, y: Value) -> Value:
    """Subtract vectors of floats or of integers."""
    return b.fsub(x, y, flags=FUSED) if x.type == FLOATS else b.sub(x, y)


def _walsh_hadamard(b: Builder, rows: Sequence[Value]) -> list[Value]:
    """Transform over a list of rows, of integers or floats, in registers, natural order."""
    a = list(rows)
    half = 1
    while half < len(a):
        for start in range(0, len(a), 2 * half):
            for k in range(start, start + half):
                a[k], a[k + half] = add(b, a[k], a[k + half]), subtract(b, a[k], a[k + half])
        half *= 2
    return a


def _walsh_hadamard_lanes(b: Builder, rows: Sequence[Value], chip: int) -> list[Value]:
    """Transform over the chips within as many rows, natural order; chip i of a result belongs to row i.

    Two rows are parted into the chips that differ in one bit of their place, and these are added and
    subtracted.
    """
    if len(rows) == 1:
        return list(rows)
    lanes = range(2 * LANES // chip)
    low = [chip * lane + i for lane in lanes if not lane & len(rows) // 2 for i in range(chip)]
    high = [chip * lane + i for lane in lanes if lane & len(rows) // 2 for i in range(chip)]
    parted = [(shuffle(b, x, y, low), shuffle(b, x, y, high)) for x, y in zip(rows[::2], rows[1::2], strict=True)]
    sums = [add(b, x, y) for x, y in parted]
    differences = [subtract(b, x, y) for x, y in parted]
    return _walsh_hadamard_lanes(b, sums, chip) + _walsh_hadamard_lanes(b, differences, chip)


def _pair_sums(b: Builder, x: Value, y: Value) -> Value:
    """Sum numbers 2k and 2k + 1 of 32 products x*y of int16, to 16 int32."""
    result = ir.VectorType(I32, LANES)
    kind = ir.FunctionType(result, [SHORTS, SHORTS])
    return b.call(cgutils.get_or_insert_function(b.module, kind, "llvm.x86.avx512.pmaddw.d.512"), [x, y])


ONES = ir.Constant(SHORTS, [ir.Constant(I16, 1)] * (2 * LANES))


def _chip_row(b: Builder, chips: Sequence[Value]) -> Value:
    """Sum the two samples of each of four chips: int16 (I, Q) x 4 samples from the chip on, to a row of 16 int32."""
    order = [8 * k + i for k in range(4) for i in (0, 2, 1, 3, 2, 4, 3, 5)]
    samples = _join(b, chips)
    return _pair_sums(b, shuffle(b, samples, samples, order), ONES)


def _gathered(b: Builder, base: Value, offsets: Value, row: int, per_row: int, kind: Any, scale: int) -> list[Value]:
    """Load the chips of a row, each from ``base`` plus ``scale`` times its offset (uint32)."""
    chips = []
    for lane in range(per_row):
        offset = b.zext(load(b, offsets, 4 * (per_row * row + lane), I32, 4), I64)
        chips.append(load(b, b.add(base, b.mul(offset, _int(scale))), 0, kind, 2))
    return chips


def procedure(emit: Callable[..., None], addresses: int, *literals: Any) -> tuple[Any, Callable[..., Value]]:
    """Make what numba asks of an intrinsic that takes ``literals``, known to ``emit`` already, and then addresses."""
    signature = types.void(*literals, *[types.intp] * addresses)

    def generate(context: Any, builder: Builder, _signature: Any, values: Sequence[Value]) -> Value:
        emit(builder, *values[len(literals) :])
        return context.get_dummy_value()

    return signature, generate


@intrinsic(prefer_literal=True)
def gather_samples(_context: Any, rows: Any, samples: Any, offsets: Any, z: Any) -> Any:
    """Gather 64 chips of 2 samples each from int16 samples to 16 rows, summed over samples, and transform the rows.

    Offsets are in bytes, of the chips of row 0, then row 1...; the rows are stored ``rows`` rows apart.
    """

    def emit(b: Builder, samples: Value, offsets: Value, z: Value) -> None:
        kind = ir.VectorType(I16, 8)
        chips = [_chip_row(b, _gathered(b, samples, offsets, row, 4, kind, 1)) for row in range(16)]
        for i, row in enumerate(_walsh_hadamard(b, chips)):
            store(b, b.sitofp(row, FLOATS), z, LINE * rows.literal_value * i)

    return procedure(emit, 3, rows)


@intrinsic(prefer_literal=True)
def gather_chips(_context: Any, chip: Any, rows: Any, sums: Any, offsets: Any, z: Any) -> Any:
    """Gather chips of ``chip`` float32 to `FIRST_RADIX` rows, stored ``rows`` rows apart, and transform them.

    Offsets are in units of two bytes, so that they serve `gather_samples` as well.
    """

    def emit(b: Builder, sums: Value, offsets: Value, z: Value) -> None:
        width = chip.literal_value
        kind = ir.VectorType(F32, width)
        gathered = [_gathered(b, sums, offsets, i, LANES // width, kind, 2) for i in range(FIRST_RADIX[width])]
        for i, row in enumerate(_walsh_hadamard(b, [_join(b, chips) for chips in gathered])):
            store(b, row, z, LINE * rows.literal_value * i)

    return procedure(emit, 3, chip, rows)


def upper_radix(rows: int) -> int:
    """Number of rows of the first of two middle passes; between them they leave 8 neighbours of ``rows`` rows."""
    left = rows // 8
    if left <= 16:
        return left
    return 16 if left == 128 else 8


def _transform_in_place(b: Builder, z: Value, radix: int, stride: int) -> None:
    rows = [load(b, z, LINE * stride * i, FLOATS, LINE) for i in range(radix)]
    for i, row in enumerate(_walsh_hadamard(b, rows)):
        store(b, row, z, LINE * stride * i)


@intrinsic(prefer_literal=True)
def upper_rows(_context: Any, rows: Any, z: Any) -> Any:
    """Transform `upper_radix` rows that are spread over a block of ``rows`` rows, in place."""

    def emit(b: Builder, z: Value) -> None:
        radix = upper_radix(rows.literal_value)
        _transform_in_place(b, z, radix, rows.literal_value // radix)

    return procedure(emit, 1, rows)


@intrinsic(prefer_literal=True)
def lower_rows(_context: Any, rows: Any, z: Any) -> Any:
    """Transform the rows that `upper_rows` leaves but for the 8 neighbours, in place."""

    def emit(b: Builder, z: Value) -> None:
        _transform_in_place(b, z, rows.literal_value // 8 // upper_radix(rows.literal_value), 8)

    return procedure(emit, 1, rows)


def _last_rows(b: Builder, z: Value, chip: int) -> list[Value]:
    """Transform 8 neighbouring rows, and then over the chips within each row."""
    rows = _walsh_hadamard(b, [load(b, z, LINE * i, FLOATS, LINE) for i in range(8)])
    size = LANES // chip
    return [row for k in range(0, 8, size) for row in _walsh_hadamard_lanes(b, rows[k : k + size], chip)]


@intrinsic(prefer_literal=True)
def last_rows(_context: Any, chip: Any, z: Any) -> Any:
    """Transform 8 neighbouring rows, and the chips within, in place; a result's chips belong to as many old rows."""

    def emit(b: Builder, z: Value) -> None:
        for i, row in enumerate(_last_rows(b, z, chip.literal_value)):
            store(b, row, z, LINE * i)

    return procedure(emit, 1, chip)


@intrinsic(prefer_literal=True)
def last_rows_power(_context: Any, chip: Any, z: Any, power: Any) -> Any:
    """Like `last_rows`, but add the squares of the results to ``power`` and do not keep them."""

    def emit(b: Builder, z: Value, power: Value) -> None:
        for i, row in enumerate(_last_rows(b, z, chip.literal_value)):
            total = load(b, power, LINE * i, FLOATS, LINE)
            store(b, add(b, b.fmul(row, row, flags=FUSED), total), power, LINE * i)

    return procedure(emit, 2, chip)


def _add_two(b: Builder, x: Value, y: Value, sums: Value) -> None:
    """Add 32 int16 of x and of y to 32 int32 sums, which are kept in the order of `sum_order`."""
    for half in range(2):
        lanes = [8 * lane + 4 * half + k for lane in range(4) for k in range(4)]
        pairs = shuffle(b, x, y, [i for lane in lanes for i in (lane, 2 * LANES + lane)])
        total = load(b, sums, LINE * half, ir.VectorType(I32, LANES), LINE)
        store(b, b.add(total, _pair_sums(b, pairs, ONES)), sums, LINE * half)


def sum_order(position: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Tell which number is at a position of the sums that `copy_two` keeps: lanes of 128 bits are interleaved."""
    block, half, lane, k = position // 32, position // 16 % 2, position // 4 % 4, position % 4
    return 32 * block + 8 * lane + 4 * half + k


@intrinsic
def copy_two(_context: Any, x: Any, y: Any, to_x: Any, to_y: Any, sums: Any) -> Any:
    """Copy 32 int16 of each of two captures, and add both to the sums."""

    def emit(b: Builder, x: Value, y: Value, to_x: Value, to_y: Value, sums: Value) -> None:
        from_x, from_y = load(b, x, 0, SHORTS, 2), load(b, y, 0, SHORTS, 2)
        store(b, from_x, to_x, 0)
        store(b, from_y, to_y, 0)
        _add_two(b, from_x, from_y, sums)

    return procedure(emit, 5)


@intrinsic
def copy_two_ends(_context: Any, x: Any, y: Any, to_x: Any, to_y: Any, sums: Any) -> Any:
    """Copy the last 28 int16 of each of two captures, four zeros behind them, and add both to the sums."""

    def emit(b: Builder, x: Value, y: Value, to_x: Value, to_y: Value, sums: Value) -> None:
        zeros = ir.Constant(SHORTS, [ir.Constant(I16, 0)] * (2 * LANES))
        ends = []
        for source, target in ((x, to_x), (y, to_y)):
            # The load begins four numbers early rather than read beyond the recording.
            early = load(b, source, -8, SHORTS, 2)
            end = shuffle(b, early, zeros, [*range(4, 32), 32, 33, 34, 35])
            store(b, end, target, 0)
            ends.append(end)
        _add_two(b, ends[0], ends[1], sums)

    return procedure(emit, 5)


@intrinsic
def prefetch(_context: Any, address: Any) -> Any:
    """Ask for a cache line, any address will do, in the second level: the first is full of the transforms' work."""

    def emit(b: Builder, address: Value) -> None:
        kind = ir.FunctionType(ir.VoidType(), [I8.as_pointer(), I32, I32, I32])
        function = cgutils.get_or_insert_function(b.module, kind, "llvm.prefetch.p0")
        read, second_level, data = ir.Constant(I32, 0), ir.Constant(I32, 2), ir.Constant(I32, 1)
        b.call(function, [b.inttoptr(address, I8.as_pointer()), read, second_level, data])

    return procedure(emit, 1)
