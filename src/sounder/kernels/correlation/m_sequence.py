"""Correlation of captures with an m-sequence, and its averages over snapshots."""

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import numpy.typing as npt

from sounder.kernels.correlation import avx512, avx512_instructions, portable
from sounder.kernels.correlation.captures import Averages, Captures, flat_captures
from sounder.kernels.correlation.permutations import permutations
from sounder.kernels.correlation.reference import chip_template, walsh_hadamard
from sounder.kernels.correlation.tables import State

ORDERS = range(7, 16)
"""Orders of sequences that a sounder description admits."""
SAMPLES_PER_CHIP = range(1, 5)
"""Samples a chip that a sounder description admits."""
BLOCK = 64
"""Captures that `MSequenceCorrelator.correlate` converts to float32 at a time: 0.5 MB at order 9; not critical."""


class MSequenceCorrelator:
    """Circular correlation with a held m-sequence, ``t = repeat(1 - 2*chips, samples_per_chip)``.

    ``c[k] = sum_n x[n + k] t[n]``: a capture delayed by k samples peaks at k. Nothing is normalised: the
    template's own correlation is 1022 at 0, 510 at 1 and -1, -2 elsewhere, for 511 chips of 2 samples.

    Captures are int16 (snapshot, sample, 2) or complex64 (snapshot, sample). int16 captures are summed
    exactly; the transforms are float32. Threads may share a correlator.

    Parameters
    ----------
    chips : array (2**order - 1,)
        m-sequence of order 7 to 15 as 0 and 1, any shift, direction and polarity.
    samples_per_chip : int
        1 to 4.

    Attributes
    ----------
    samples, chips : int
        Of a capture.

    Raises
    ------
    ValueError
        The sequence is no m-sequence, or out of this range.

    Examples
    --------
    A capture of two snapshots, delayed by 30 samples:

    >>> import numpy as np
    >>> from sounder.instrument.waveform import m_sequence
    >>> chips = m_sequence(7, (7, 1, 0))
    >>> correlator = MSequenceCorrelator(chips, samples_per_chip=2)
    >>> samples = np.roll(np.repeat(1 - 2 * chips, 2), 30)
    >>> captures = np.zeros((2, 254, 2), np.int16)
    >>> captures[..., 0] = samples
    >>> correlation, power = correlator.average(captures)
    >>> int(np.argmax(power)), complex(correlation[30])
    (30, (254+0j))
    """

    def __init__(self, chips: npt.ArrayLike, samples_per_chip: int) -> None:
        found = permutations(chips)
        if found.order not in ORDERS or samples_per_chip not in SAMPLES_PER_CHIP:
            raise ValueError(
                f"sequence: order {found.order} at {samples_per_chip} samples per chip; "
                "expected order 7 to 15 at 1 to 4"
            )
        self._chips = np.asarray(chips, np.int8)
        self.samples = found.input.size * samples_per_chip
        self.samples_per_chip, self.chips = samples_per_chip, found.input.size
        layout = avx512 if avx512_instructions.available() and found.order in avx512.ORDERS else portable
        self._tables = layout.tables(found, samples_per_chip)
        self._kernels = layout.kernels(found.order, samples_per_chip)
        self._new_state = partial(layout.state, self._tables)
        self._idle: list[State] = []  # a state costs as much to make as 50 captures to average

    def __reduce__(self) -> tuple[type, tuple[npt.NDArray[np.int8], int]]:
        """Travel to other processes as the sequence; machine code stays here."""
        return MSequenceCorrelator, (self._chips, self._tables.samples_per_chip)

    @property
    def template(self) -> npt.NDArray[np.float64]:
        """The held sequence (sample,): +1 and -1."""
        return chip_template(self._chips, self.samples_per_chip)

    def average(self, iq: Captures) -> Averages:
        """Average one direction: mean correlation, complex64 (sample,), and mean power, float64 (sample,)."""
        sums = self.accumulator()
        sums.add(iq)
        return sums.result()

    def correlate(self, iq: Captures) -> npt.NDArray[np.complex64]:
        """Correlate every capture by itself: complex64 (snapshot, sample)."""
        x = flat_captures(iq, self.samples)
        out = np.empty((len(x), self.samples), np.complex64)
        flat = out.view(np.float32)
        with self._borrowed_state() as state:
            for first in range(0, len(x), BLOCK):
                block = x[first : first + BLOCK].astype(np.float32, copy=False)
                block.flags.writeable = False
                self._kernels.correlate_float32(block, self._tables, state, flat[first : first + BLOCK])
        return out

    def correlate_mean(self, x: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Correlate one vector (sample,), such as an averaged capture, in float64: complex128 (sample,)."""
        capture = np.array(x, np.complex128, ndmin=1)
        if capture.shape != (self.samples,):
            raise ValueError(
                f"capture: shape {capture.shape}; expected ({self.samples},); check order and samples per chip"
            )
        chips, spc = self._tables.rows.size, self._tables.samples_per_chip
        sums = sum(np.roll(capture, -shift) for shift in range(spc))
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


class MSequenceAccumulator:
    """Averages of captures that arrive in blocks; any blocks give the same bits as all captures at once."""

    def __init__(self, correlator: MSequenceCorrelator) -> None:
        self.count = 0
        self._samples, self._tables, self._kernels = correlator.samples, correlator._tables, correlator._kernels
        self._state = correlator._idle_state()
        weakref.finalize(self, correlator._idle.append, self._state)

    def add(self, iq: Captures) -> None:
        """Add captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample)."""
        x = flat_captures(iq, self._samples)
        add = self._kernels.add_int16 if x.dtype == np.int16 else self._kernels.add_float32
        add(x, self.count, self._tables, self._state)
        self.count += len(x)

    def result(self) -> Averages:
        """Return mean correlation and mean power of all captures so far; more may follow."""
        if not self.count:
            raise ValueError("captures: 0 snapshots; expected one or more")
        correlation, power = np.empty(self._samples, np.complex64), np.empty(self._samples)
        self._kernels.means(self.count, self._tables, self._state, correlation.view(np.float32), power)
        return correlation, power
