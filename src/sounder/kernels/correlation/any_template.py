"""Correlation of captures with any periodic template, by FFT.

``c = ifft(fft(x) conj(fft(t)))`` over one period. Where the period has a large prime factor (1022 = 2 * 7 *
73) the FFT is slow; then captures are padded with zeros to a fast length of at least two periods, and the
linear correlation is folded: ``c[k] = y[k] + y[length - period + k]``. Periods of up to 1024 samples have a
route of their own for averages, `short_template`, on processors with AVX-512.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import fft

from erm.common.errors import DataError
from sounder.kernels.compiler.compile import jit
from sounder.kernels.correlation import avx512_instructions, short_template
from sounder.kernels.correlation.captures import Averages, Captures, flat_captures

BLOCK = 16  # captures transformed at a time, so that they stay in the nearer caches


@jit
def load_int16(x: Captures, block: Captures, total: Captures) -> None:
    """Copy captures (capture, number) into the padded block, and add them to the coherent sum."""
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            block[i, t] = np.float32(x[i, t])
            total[t] += x[i, t]


@jit
def load_float32(x: Captures, block: Captures, total: Captures) -> None:
    """Like `load_int16`, of single-precision captures."""
    for i in range(x.shape[0]):
        for t in range(x.shape[1]):
            block[i, t] = x[i, t]
            total[t] += x[i, t]


@jit
def add_power(y: Captures, period: int, total: Captures) -> None:
    """Fold correlations (capture, length) to a period and add their squared magnitudes."""
    fold = y.shape[1] - period
    for i in range(y.shape[0]):
        if fold == 0:
            for k in range(period):
                c = y[i, k]
                total[k] += c.real * c.real + c.imag * c.imag
        else:
            for k in range(period):
                c = y[i, k] + y[i, fold + k]
                total[k] += c.real * c.real + c.imag * c.imag


class TemplateCorrelator:
    """Circular correlation with a periodic template: ``c[k] = sum_n x[n + k] conj(t[n])``.

    A capture delayed by k samples peaks at k. Nothing is normalised. Takes and gives the same as
    `average.MSequenceCorrelator`; the correlation of single captures is float32, that of the mean float64.

    Parameters
    ----------
    template : array (sample,)
        One period, real or complex.
    """

    def __init__(self, template: npt.ArrayLike) -> None:
        t = np.asarray(template, np.complex128)
        if t.ndim != 1 or not t.size or not np.isfinite(t).all() or not t.any():
            raise DataError(f"template: shape {t.shape}, expected one period of finite samples, not all of them zero")
        self.samples = t.size
        self._template = t
        self._length = t.size if _fast(t.size) else fft.next_fast_len(2 * t.size)
        short = avx512_instructions.available() and t.size <= short_template.LONGEST
        self._filter = short_template.make_filter(t) if short else None
        self._spectrum = np.conj(fft.fft(t, self._length)).astype(np.complex64)

    def __reduce__(self) -> tuple[type, tuple[npt.NDArray[np.complex128]]]:
        """Travel to other processes as the template."""
        return TemplateCorrelator, (self._template,)

    def average(self, iq: Captures) -> Averages:
        """Average one direction: mean correlation, complex64 (sample,), and mean power, float64 (sample,)."""
        sums = self.accumulator()
        sums.add(iq)
        return sums.result()

    def average_directions(self, iq: Captures, correlation: Captures, power: Captures) -> None:
        """Average captures (direction, snapshot, ...) into the two given arrays (direction, sample)."""
        for d, captures in enumerate(iq):
            correlation[d], power[d] = self.average(captures)

    def correlate(self, iq: Captures) -> npt.NDArray[np.complex64]:
        """Correlate every capture by itself: complex64 (snapshot, sample)."""
        x = flat_captures(iq, self.samples, dims=2)
        out = np.empty((len(x), self.samples), np.complex64)
        ignored = np.zeros(2 * self.samples)
        for first in range(0, len(x), BLOCK):
            y = self._transform(x[first : first + BLOCK], ignored)
            out[first : first + BLOCK] = y[:, : self.samples]
            if self._length > self.samples:
                out[first : first + BLOCK] += y[:, -self.samples :]
        return out

    def correlate_mean(self, x: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Correlate one vector (sample,), such as an averaged capture, in float64: complex128 (sample,)."""
        vector = np.asarray(x, np.complex128)
        if vector.shape != (self.samples,):
            raise DataError(f"capture: shape {vector.shape}, expected ({self.samples},); check the template's length")
        return fft.ifft(fft.fft(vector) * np.conj(fft.fft(self._template)))

    def accumulator(self) -> "TemplateAccumulator":
        """Return empty sums that are fed in blocks."""
        return TemplateAccumulator(self)

    def _transform(self, x: Captures, total: Captures) -> Captures:
        """Correlate a block of flat captures, padded, and add them to the coherent sum."""
        block = np.zeros((len(x), 2 * self._length), np.float32)
        load = load_int16 if x.dtype == np.int16 else load_float32
        load(x, block, total)
        spectra = fft.fft(block.view(np.complex64), overwrite_x=True)
        spectra *= self._spectrum
        return fft.ifft(spectra, overwrite_x=True)


class TemplateAccumulator:
    """Averages of captures that arrive in blocks; the same bits for any blocks of a multiple of `BLOCK` captures."""

    def __init__(self, correlator: TemplateCorrelator) -> None:
        self.count = 0
        self._correlator = correlator
        self._samples = np.zeros(2 * correlator.samples)
        self._power = np.zeros(correlator.samples)
        self._work: dict[np.dtype[Any], short_template.Work] = {}

    def add(self, iq: Captures) -> None:
        """Add captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample)."""
        x = flat_captures(iq, self._correlator.samples, dims=2)
        if self._correlator._filter:
            if x.dtype not in self._work:
                self._work[x.dtype] = short_template.make_work(x.dtype)
            run = short_template.run_int16 if x.dtype == np.int16 else short_template.run_float32
            run(x, self.count, self._correlator._filter, self._work[x.dtype], self._samples)
        else:
            for first in range(0, len(x), BLOCK):
                y = self._correlator._transform(x[first : first + BLOCK], self._samples)
                add_power(y, self._correlator.samples, self._power)
        self.count += len(x)

    def result(self) -> Averages:
        """Return mean correlation and mean power of all captures so far; more may follow."""
        if not self.count:
            raise DataError("captures: none were added, expected one or more; check that the recording has snapshots")
        mean = self._samples.view(np.complex128) / self.count
        power = self._power / self.count
        for work in self._work.values():
            power += short_template.mean_power(work, self._correlator.samples, self.count)
        return self._correlator.correlate_mean(mean).astype(np.complex64), power


def _fast(length: int) -> bool:
    """Tell whether the FFT of a length needs no padding: all prime factors up to 11."""
    for prime in (2, 3, 5, 7, 11):
        while length % prime == 0:
            length //= prime
    return length == 1
