"""Correlation of captures with an m-sequence, and its averages over snapshots."""

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import numpy.typing as npt

from erm.common.errors import DataError
from sounder.kernels.correlation import avx512, avx512_instructions, portable
from sounder.kernels.correlation.captures import Averages, Captures, flat_captures
from sounder.kernels.correlation.permutations import permutations
from sounder.kernels.correlation.reference import walsh_hadamard
from sounder.kernels.correlation.tables import State

ORDERS = range(7, 16)
SAMPLES_PER_CHIP = range(1, 5)
BLOCK = 64  # captures converted at a time


class MSequenceCorrelator:
    """Circular correlation with a held m-sequence, ``t = repeat(1 - 2*chips, samples_per_chip)``.

    ``c[k] = sum_n x[n + k] t[n]``: a capture delayed by k samples peaks at k. Nothing is normalised: the
    template's own correlation is 1022 at 0, 510 at 1 and -1, -2 elsewhere, for 511 chips of 2 samples.

    Captures are int16 (snapshot, sample, 2) or complex64 (snapshot, sample). int16 captures are summed
    exactly; the transforms are float32, the mean correlation is transformed in float64.

    Parameters
    ----------
    chips : array (2**order - 1,)
        m-sequence of order 7 to 15 as 0 and 1, any shift, direction and polarity.
    samples_per_chip : int
        1 to 4.
    """

    def __init__(self, chips: npt.ArrayLike, samples_per_chip: int) -> None:
        found = permutations(chips)
        if found.order not in ORDERS or samples_per_chip not in SAMPLES_PER_CHIP:
            raise DataError(
                f"sequence: order {found.order} at {samples_per_chip} samples a chip, expected order 7 to 15 "
                "at 1 to 4; correlate with a template instead"
            )
        self._chips = np.asarray(chips, np.int8)
        self.samples = found.input.size * samples_per_chip
        layout = avx512 if avx512_instructions.available() and found.order in avx512.ORDERS else portable
        self._tables = layout.tables(found, samples_per_chip)
        self._path = layout.path(found.order, samples_per_chip)
        self._new_state = partial(layout.state, self._tables)
        self._idle: list[State] = []  # a state costs as much to make as 50 captures to average

    def __reduce__(self) -> tuple[type, tuple[npt.NDArray[np.int8], int]]:
        """Travel to other processes as the sequence; machine code stays at home."""
        return MSequenceCorrelator, (self._chips, self._tables.samples_per_chip)

    def average(self, iq: Captures) -> Averages:
        """Average one direction: mean correlation, complex64 (sample,), and mean power, float64 (sample,)."""
        x = flat_captures(iq, self.samples, dims=2)[np.newaxis]
        if not x.shape[1]:
            raise DataError("captures: 0 snapshots in a direction, expected one or more; leave the direction out")
        correlation = np.empty((1, self.samples), np.complex64)
        power = np.empty((1, self.samples))
        with self._borrowed_state() as state:
            self._run(x, 0, state, correlation, power)
        return correlation[0], power[0]

    def correlate(self, iq: Captures) -> npt.NDArray[np.complex64]:
        """Correlate every capture by itself: complex64 (snapshot, sample)."""
        x = flat_captures(iq, self.samples, dims=2)
        out = np.empty((len(x), self.samples), np.complex64)
        flat = out.view(np.float32)
        with self._borrowed_state() as state:
            for first in range(0, len(x), BLOCK):
                block = x[first : first + BLOCK].astype(np.float32, copy=False)
                block.flags.writeable = False
                self._path.correlate_float32(block, self._tables, state, flat[first : first + BLOCK])
        return out

    def correlate_mean(self, x: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Correlate one vector (sample,), such as an averaged capture, in float64: complex128 (sample,)."""
        avx512 = np.array(x, np.complex128, ndmin=1)
        if avx512.shape != (self.samples,):
            raise DataError(
                f"capture: shape {avx512.shape}, expected ({self.samples},); check order and samples a chip"
            )
        chips, spc = self._tables.rows.size, self._tables.samples_per_chip
        sums = sum(np.roll(avx512, -shift) for shift in range(spc))
        z = np.zeros((chips + 1, spc), complex)
        z[self._tables.rows] = np.reshape(sums, (chips, spc))
        return self._tables.polarity * walsh_hadamard(z)[self._tables.delays].ravel()

    def accumulator(self) -> "MSequenceAccumulator":
        """Return empty sums that are fed in blocks."""
        return MSequenceAccumulator(self)

    @contextmanager
    def _borrowed_state(self) -> Iterator[State]:
        """Lend a state to one thread."""
        state = self._idle_state()
        yield state
        self._idle.append(state)

    def _idle_state(self) -> State:
        """Take a state that nobody uses; lists are safe to share."""
        try:
            return self._idle.pop()
        except IndexError:
            return self._new_state()

    def _run(self, x: Captures, seen: int, state: State, correlation: Captures, power: Captures) -> None:
        run = self._path.run_int16 if x.dtype == np.int16 else self._path.run_float32
        run(x, seen, self._tables, state, correlation.view(np.float32), power)


class MSequenceAccumulator:
    """Averages of captures that arrive in blocks; any blocks give the same bits as all captures at once."""

    def __init__(self, correlator: MSequenceCorrelator) -> None:
        self.count = 0
        self._correlator = correlator
        self._state = correlator._idle_state()
        weakref.finalize(self, correlator._idle.append, self._state)

    def add(self, iq: Captures) -> None:
        """Add captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample)."""
        samples = self._correlator.samples
        x = flat_captures(iq, samples, dims=2)[np.newaxis]
        nowhere = np.empty((0, samples), np.complex64), np.empty((0, samples))
        self._correlator._run(x, self.count, self._state, *nowhere)
        self.count += x.shape[1]

    def result(self) -> Averages:
        """Return mean correlation and mean power of all captures so far; more may follow."""
        if not self.count:
            raise DataError("captures: none were added, expected one or more; check that the recording has snapshots")
        samples = self._correlator.samples
        correlation, power = np.empty((1, samples), np.complex64), np.empty((1, samples))
        nothing = flat_captures(np.empty((1, 0, samples, 2), np.int16), samples, dims=3)
        self._correlator._run(nothing, self.count, self._state, correlation, power)
        return correlation[0], power[0]
