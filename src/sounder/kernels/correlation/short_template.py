"""Correlation with a template of up to 1024 samples by an FFT of 2048 in registers.

A capture, repeated periodically to 2048 samples, is filtered with ``q[m] = conj(t[-m])``, which is no longer
than 1024: from sample 1023 on the linear convolution has forgotten its beginning and is the circular one of
period N. The later half, samples 1024 to 2047, holds every delay once, and nothing is to be folded.

The FFT splits n = 256 h + 16 j + l (h < 8; j, l < 16): over h while the (int16) captures are loaded, over j
and l in registers together with the filter and the way back, and over h again while squares are added. The
spectrum stays in the order it comes in; the response is put into that order once.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import jit, part
from sounder.kernels.compiler.struct import bundle
from sounder.kernels.correlation import accumulate, simd_fft
from sounder.kernels.correlation.tables import zeros

LENGTH = 2048
LONGEST = LENGTH // 2

Array = Any


@bundle
class Filter(NamedTuple):
    """Constants of one template."""

    period: int
    high: Array  # float32 (l row, h) pairs: exp(-2j pi (n mod 256 // 16) h / 128)
    low: Array  # float32 (h, j) rows: exp(-2j pi l (h + 8 j) / 2048)
    response: Array  # float32 (h, l) rows, in the order of the spectrum


@bundle
class Work(NamedTuple):
    """Work space and running sums of one thread."""

    extended: Array  # int16 or float32, one capture repeated
    z: Array  # float32
    power: Array  # float32, since the last flush
    power_total: Array  # float64


def make_filter(template: npt.NDArray[np.complex128]) -> Filter:
    """Prepare the correlation with a template of up to `LONGEST` samples."""
    q = np.conj(np.roll(template[::-1], 1))
    spectrum = np.fft.fft(q, LENGTH) / LENGTH
    j, h = np.ogrid[:16, :8]
    high = np.exp(-2j * np.pi * j * h / 128)
    h, k, l = np.ogrid[:8, :16, :16]  # noqa: E741 - the splitting's own names
    low = np.exp(-2j * np.pi * l * (h + 8 * k) / LENGTH)
    response = spectrum[(h + 8 * l) + 128 * k]
    return Filter(template.size, _interleaved(high), _rows(low), _rows(response))


def _interleaved(values: npt.NDArray[np.complex128]) -> npt.NDArray[np.float32]:
    out = zeros(2 * values.size, np.float32)
    out[:] = values.astype(np.complex64).ravel().view(np.float32)
    return out


def _rows(values: npt.NDArray[np.complex128]) -> npt.NDArray[np.float32]:
    """Put real parts of 16 before their imaginary parts."""
    out = zeros(2 * values.size, np.float32)
    out[:] = np.stack([values.real, values.imag], axis=-2).ravel()
    return out


def make_work(kind: npt.DTypeLike) -> Work:
    """Allocate work space for captures of int16 or float32."""
    return Work(
        zeros(2 * LENGTH, kind),
        zeros(2 * LENGTH, np.float32),
        zeros(LONGEST, np.float32),
        zeros(LONGEST, np.float64),
    )


@part
def extend(x: Array, i: int, extended: Array) -> None:
    """Repeat capture i periodically."""
    numbers = x.shape[1]
    for first in range(0, extended.size, numbers):
        for t in range(min(numbers, extended.size - first)):
            extended[first + t] = x[i, t]


@part
def filter_all(z: Array, tables: Filter) -> None:
    """Filter between the first and the last pass."""
    for h in range(8):
        place = 2048 * h
        simd_fft.filter_block(
            z.ctypes.data + place, tables.low.ctypes.data + place, tables.response.ctypes.data + place
        )


@part
def add_power(z: Array, tables: Filter, power: Array) -> None:
    """Do the last pass and add the squared magnitudes."""
    for j in range(16):
        simd_fft.last_pass_power(z.ctypes.data + 128 * j, tables.high.ctypes.data + 64 * j, power.ctypes.data + 64 * j)


@jit
def run_int16(x: Array, seen: int, tables: Filter, work: Work, samples: Array) -> None:
    """Add captures (capture, number) to the power and, float64, to ``samples``; ``seen`` went before."""
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            samples[t] += x[i, t]
        extend(x, i, work.extended)
        for j in range(16):
            simd_fft.first_pass_int16(
                work.extended.ctypes.data + 64 * j, work.z.ctypes.data + 128 * j, tables.high.ctypes.data + 64 * j
            )
        filter_all(work.z, tables)
        add_power(work.z, tables, work.power)
        if (seen + i + 1) % accumulate.FLUSH_POWER == 0:
            accumulate.flush(work.power, work.power_total)


@jit
def run_float32(x: Array, seen: int, tables: Filter, work: Work, samples: Array) -> None:
    """Like `run_int16`, of single-precision captures."""
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            samples[t] += x[i, t]
        extend(x, i, work.extended)
        for j in range(16):
            simd_fft.first_pass_float32(
                work.extended.ctypes.data + 128 * j, work.z.ctypes.data + 128 * j, tables.high.ctypes.data + 64 * j
            )
        filter_all(work.z, tables)
        add_power(work.z, tables, work.power)
        if (seen + i + 1) % accumulate.FLUSH_POWER == 0:
            accumulate.flush(work.power, work.power_total)


def mean_power(work: Work, period: int, count: int) -> npt.NDArray[np.float64]:
    """Return the mean power of ``count`` captures, delays in order."""
    total = work.power_total[:period] + work.power[:period]
    return np.roll(total, LONGEST % period) / count
