"""FFT of 2048 samples in vector instructions, as functions for compiled code; written with `simd`'s pieces.

A *row* is 16 complex samples: a register of real and one of imaginary parts, 128 bytes in memory.
"""

from collections.abc import Sequence
from math import cos, pi, sin
from typing import Any

from llvmlite import ir
from numba.extending import intrinsic

from sounder.kernels.correlation.avx512_instructions import (
    F32,
    FLOATS,
    FUSED,
    I32,
    LANES,
    LINE,
    add,
    load,
    procedure,
    shuffle,
    store,
    subtract,
)

ROW = 2 * LINE

Builder = Any
Value = Any
Complex = tuple[Value, Value]


def _everywhere(number: float) -> Value:
    return ir.Constant(FLOATS, [ir.Constant(F32, number)] * LANES)


def _times(b: Builder, x: Value, y: Value) -> Value:
    return b.fmul(x, y, flags=FUSED)


def _multiply(b: Builder, x: Complex, y: Complex, sign: int = 1) -> Complex:
    """Multiply x with y, or with its conjugate where ``sign`` is -1."""
    plus, minus = (add, subtract) if sign > 0 else (subtract, add)
    return (
        minus(b, _times(b, x[0], y[0]), _times(b, x[1], y[1])),
        plus(b, _times(b, x[1], y[0]), _times(b, x[0], y[1])),
    )


def _butterfly(b: Builder, e: Complex, o: Complex, angle: float) -> tuple[Complex, Complex]:
    """Return e + w o and e - w o with w = exp(j angle), by multiply-adds: w = c (1 + j t) or s (t + j)."""
    c, s = cos(angle), sin(angle)
    if abs(c) >= abs(s):
        scale, t = _everywhere(c), _everywhere(s / c)
        real = subtract(b, o[0], _times(b, o[1], t))
        imaginary = add(b, o[1], _times(b, o[0], t))
    else:
        scale, t = _everywhere(s), _everywhere(c / s)
        real = subtract(b, _times(b, o[0], t), o[1])
        imaginary = add(b, _times(b, o[1], t), o[0])
    real, imaginary = _times(b, real, scale), _times(b, imaginary, scale)
    return (
        (add(b, e[0], real), add(b, e[1], imaginary)),
        (subtract(b, e[0], real), subtract(b, e[1], imaginary)),
    )


def _fft(b: Builder, rows: Sequence[Complex], sign: int) -> list[Complex]:
    """Transform over a list of rows, in registers: ``sum_n x[n] exp(sign 2j pi n k / length)``, natural order."""
    length = len(rows)
    if length == 1:
        return list(rows)
    even, odd = _fft(b, rows[0::2], sign), _fft(b, rows[1::2], sign)
    result = [even[0]] * length
    for k in range(length // 2):
        e, o = even[k], odd[k]
        if 4 * k == length:
            o = (_negative(b, o[1]), o[0]) if sign > 0 else (o[1], _negative(b, o[0]))
        if k == 0 or 4 * k == length:
            result[k] = add(b, e[0], o[0]), add(b, e[1], o[1])
            result[k + length // 2] = subtract(b, e[0], o[0]), subtract(b, e[1], o[1])
        else:
            result[k], result[k + length // 2] = _butterfly(b, e, o, sign * 2 * pi * k / length)
    return result


def _negative(b: Builder, x: Value) -> Value:
    return b.fsub(_everywhere(-0.0), x)


def _transpose(b: Builder, rows: Sequence[Value]) -> list[Value]:
    """Transpose 16 rows of 16 numbers, one bit of their indices after the other."""
    a = list(rows)
    for step in (1, 2, 4, 8):
        low = [lane if not lane & step else LANES + (lane ^ step) for lane in range(LANES)]
        high = [lane | step if not lane & step else LANES + lane for lane in range(LANES)]
        for k in range(LANES):
            if not k & step:
                a[k], a[k | step] = (
                    shuffle(b, a[k], a[k | step], low),
                    shuffle(b, a[k], a[k | step], high),
                )
    return a


def _transpose_complex(b: Builder, rows: Sequence[Complex]) -> list[Complex]:
    real = _transpose(b, [row[0] for row in rows])
    return list(zip(real, _transpose(b, [row[1] for row in rows]), strict=True))


def _load_row(b: Builder, address: Value, offset: int) -> Complex:
    return load(b, address, offset, FLOATS, LINE), load(b, address, offset + LINE, FLOATS, LINE)


def _store_row(b: Builder, row: Complex, address: Value, offset: int) -> None:
    store(b, row[0], address, offset)
    store(b, row[1], address, offset + LINE)


def _constant(b: Builder, address: Value, offset: int) -> Complex:
    """Load one complex number to all places of a row."""
    one = ir.VectorType(F32, 1)
    real, imaginary = load(b, address, offset, one, 4), load(b, address, offset + 4, one, 4)
    return shuffle(b, real, real, [0] * LANES), shuffle(b, imaginary, imaginary, [0] * LANES)


def _first_pass(b: Builder, rows: Sequence[Complex], z: Value, twiddles: Value) -> None:
    for k, row in enumerate(_fft(b, rows, -1)):
        turned = _multiply(b, row, _constant(b, twiddles, 8 * k)) if k else row
        _store_row(b, turned, z, 16 * ROW * k)


@intrinsic
def first_pass_int16(_context: Any, samples: Any, z: Any, twiddles: Any) -> Any:
    """Transform over the highest index, n = 256 h + ..., of 16 neighbouring int16 (I, Q) and their like."""

    def emit(b: Builder, samples: Value, z: Value, twiddles: Value) -> None:
        words = ir.VectorType(I32, LANES)
        sixteen = ir.Constant(words, [ir.Constant(I32, 16)] * LANES)
        rows = []
        for h in range(8):
            word = load(b, samples, 1024 * h, words, 4)
            real = b.sitofp(b.ashr(b.shl(word, sixteen), sixteen), FLOATS)
            rows.append((real, b.sitofp(b.ashr(word, sixteen), FLOATS)))
        _first_pass(b, rows, z, twiddles)

    return procedure(emit, 3)


@intrinsic
def first_pass_float32(_context: Any, samples: Any, z: Any, twiddles: Any) -> Any:
    """Like `first_pass_int16`, of float32 (I, Q)."""

    def emit(b: Builder, samples: Value, z: Value, twiddles: Value) -> None:
        rows = []
        for h in range(8):
            x, y = (load(b, samples, 2048 * h + half, FLOATS, 4) for half in (0, LINE))
            rows.append((shuffle(b, x, y, range(0, 32, 2)), shuffle(b, x, y, range(1, 32, 2))))
        _first_pass(b, rows, z, twiddles)

    return procedure(emit, 3)


@intrinsic
def filter_block(_context: Any, z: Any, twiddles: Any, response: Any) -> Any:
    """Transform over the two lower indices of 256 samples, multiply with the response, and transform back."""

    def emit(b: Builder, z: Value, twiddles: Value, response: Value) -> None:
        rows = _fft(b, [_load_row(b, z, ROW * i) for i in range(LANES)], -1)
        rows = [_multiply(b, row, _load_row(b, twiddles, ROW * i)) for i, row in enumerate(rows)]
        rows = _fft(b, _transpose_complex(b, rows), -1)
        rows = [_multiply(b, row, _load_row(b, response, ROW * i)) for i, row in enumerate(rows)]
        rows = _transpose_complex(b, _fft(b, rows, 1))
        rows = [_multiply(b, row, _load_row(b, twiddles, ROW * i), -1) for i, row in enumerate(rows)]
        for i, row in enumerate(_fft(b, rows, 1)):
            _store_row(b, row, z, ROW * i)

    return procedure(emit, 3)


def _last_pass(b: Builder, z: Value, twiddles: Value) -> list[Complex]:
    """Transform back over the highest index; the later half of the samples."""
    rows = [_load_row(b, z, 16 * ROW * k) for k in range(8)]
    turned = [_multiply(b, row, _constant(b, twiddles, 8 * k), -1) if k else row for k, row in enumerate(rows)]
    return _fft(b, turned, 1)[4:]


@intrinsic
def last_pass_power(_context: Any, z: Any, twiddles: Any, power: Any) -> Any:
    """Transform back over the highest index and add the squared magnitudes of the later 1024 samples."""

    def emit(b: Builder, z: Value, twiddles: Value, power: Value) -> None:
        for h, (real, imaginary) in enumerate(_last_pass(b, z, twiddles)):
            total = load(b, power, 1024 * h, FLOATS, LINE)
            total = add(b, _times(b, real, real), total)
            store(b, add(b, _times(b, imaginary, imaginary), total), power, 1024 * h)

    return procedure(emit, 3)


@intrinsic
def last_pass(_context: Any, z: Any, twiddles: Any, out: Any) -> Any:
    """Transform back over the highest index; the later 1024 samples, I and Q by turns."""

    def emit(b: Builder, z: Value, twiddles: Value, out: Value) -> None:
        for h, (real, imaginary) in enumerate(_last_pass(b, z, twiddles)):
            for half in range(2):
                lanes = [lane for k in range(8 * half, 8 * half + 8) for lane in (k, LANES + k)]
                store(b, shuffle(b, real, imaginary, lanes), out, 2048 * h + LINE * half)

    return procedure(emit, 3)
