"""The m-sequence: its chips, its sampled template, and how to identify it in a capture."""

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.instrument.waveform_description import Waveform

if TYPE_CHECKING:
    from sounder.instrument.periodic import Periodic


def m_sequence(order: int, polynomial: tuple[int, ...]) -> NDArray[np.int8]:
    """Bits of a linear-feedback shift register of full length.

    ``s[n + order] = xor of s[n + e]`` over the exponents ``e < order`` of the characteristic polynomial, started from
    ``s[0 .. order-1] = 1``.

    Parameters
    ----------
    order : int
        Degree of the polynomial.
    polynomial : tuple of int
        Its exponents, for example ``(9, 4, 0)``. It must be primitive; a sounder description is checked for that.

    Returns
    -------
    array (2**order - 1,)
        Bits 0 and 1.

    References
    ----------
    Golomb, Shift Register Sequences, 1967.

    Examples
    --------
    >>> m_sequence(3, (3, 1, 0))
    array([1, 1, 1, 0, 0, 1, 0], dtype=int8)
    """
    length = 2**order - 1
    taps = [exponent for exponent in polynomial if exponent < order]
    bits = [1] * order
    for n in range(length):
        bits.append(sum(bits[n + tap] for tap in taps) & 1)
    return np.asarray(bits[:length], np.int8)


def chips(waveform: Waveform) -> NDArray[np.int8]:
    """Bits of one period in the order and with the polarity in which they are sent; a 0 is sent as +1.

    Returns
    -------
    array (2**order - 1,)
        Bits 0 and 1.
    """
    bits = m_sequence(waveform.order, waveform.polynomial)
    if waveform.direction == "reversed":
        bits = bits[::-1].copy()
    return bits if waveform.polarity == "positive" else (1 - bits).astype(np.int8)


def held_template(waveform: "Waveform | Periodic") -> NDArray[np.float64] | NDArray[np.complex128]:
    """Template of the correlator (sample,): chips of +1 and -1, each held over ``samples_per_chip`` samples.

    Of another waveform than an m-sequence it is a period of that.
    """
    if not isinstance(waveform, Waveform):
        return waveform.sampled
    return np.repeat(1.0 - 2.0 * chips(waveform), waveform.samples_per_chip)


def band_limited_template(waveform: Waveform, passband: float = 0.9) -> NDArray[np.complex128]:
    """Transmitted waveform behind the converter's reconstruction filter, of mean power 1.

    The filter passes the spectrum of the held chips up to ``passband`` times the band edge, and falls to zero at the
    edge as a raised cosine. The edge is the chip rate or half the sample rate, whichever is less.

    Parameters
    ----------
    waveform : Waveform
        The sequence.
    passband : float
        Share of the band that is not attenuated [1]. The default is assumed, not measured.

    Returns
    -------
    array (sample,)
        One period, complex.
    """
    edge = min(waveform.chip_rate, waveform.sample_rate / 2)
    frequency = np.abs(np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate)) / edge
    roll_off = np.clip((frequency - passband) / (1 - passband), 0, 1)
    spectrum = np.fft.fft(held_template(waveform)) * (0.5 + 0.5 * np.cos(np.pi * roll_off))
    sent = np.fft.ifft(spectrum)
    return sent / np.sqrt(np.mean(np.abs(sent) ** 2))


@dataclass(frozen=True)
class Identification:
    """Which m-sequence a capture holds.

    A sequence that is reversed in time is the sequence of the reciprocal polynomial. A capture cannot tell
    ``(polynomial, forward)`` from ``(reciprocal, reversed)``; ``polynomial`` and ``direction`` are one of the two.

    Attributes
    ----------
    order, samples_per_chip : int
    polynomial : tuple of int
    direction, polarity : str
        As in the description. The polarity is the sign of the real part of the strongest path.
    margin : float
        Peak of the correlation over the highest peak of any other sequence [dB].
    """

    order: int
    samples_per_chip: int
    polynomial: tuple[int, ...]
    direction: Literal["forward", "reversed"]
    polarity: Literal["positive", "negative"]
    margin: float


def is_same_sequence(found: Identification, waveform: Waveform) -> bool:
    """Whether a found sequence is the described one, whatever its polarity.

    A reversed sequence is the sequence of the reciprocal polynomial, which has ``order - e`` for every exponent ``e``.
    """

    def forward(sequence: Identification | Waveform) -> list[int]:
        exponents = sequence.polynomial
        return sorted(sequence.order - e if sequence.direction == "reversed" else e for e in exponents)

    same_rate = found.samples_per_chip == waveform.samples_per_chip
    return same_rate and found.order == waveform.order and forward(found) == forward(waveform)


def identify(capture: NDArray[np.complex128], *, minimum_margin: float = 6.0) -> Identification:
    """Find polynomial, direction and polarity of the m-sequence in a back-to-back capture.

    All m-sequences of an order are decimations ``s[d n]`` of one of them, with one ``d`` prime to the length for each
    cyclotomic coset. Each is correlated with the capture; the one whose peak stands out was sent.

    Parameters
    ----------
    capture : array (sample,)
        Complex samples of one period, averaged over snapshots.
    minimum_margin : float
        Least margin at which a sequence counts as found [dB]. Without noise the margin is at least 8.5 dB: two
        m-sequences of these orders correlate to 383 of 1023 chips at most (Sarwate and Pursley, order 10).

    Returns
    -------
    Identification
        Of the polynomial and its reciprocal, the one with the smaller exponents is called forward.

    Raises
    ------
    DataError
        No m-sequence of order 7-15 at 1-4 samples per chip has this length, or no sequence stands out.

    References
    ----------
    Golomb, Shift Register Sequences, 1967 (decimation); Massey, IEEE Trans. Inf. Theory 15, 1969 (polynomial);
    Sarwate and Pursley, Proc. IEEE 68, 1980, table I (cross-correlation).

    Examples
    --------
    >>> from sounder import load_sounder, shipped
    >>> sent = band_limited_template(load_sounder(shipped.calibration("sounder-132ghz.toml")).waveform)
    >>> found = identify(sent)
    >>> found.order, found.polynomial, found.direction
    (9, (9, 4, 0), 'forward')
    """
    from scipy.fft import fft, ifft  # single precision, which numpy has only since version 2

    candidates = [
        (order, per_chip)
        for order in range(7, 16)
        for per_chip in range(1, 5)
        if (2**order - 1) * per_chip == capture.size
    ]
    if not candidates:
        raise DataError(
            f"{capture.size} samples per capture; expected the period of an m-sequence of order 7-15 at 1-4 samples "
            "a chip"
        )
    if (periods := _periods(capture)) > 1:
        raise DataError(
            f"the {capture.size} samples of a capture hold {periods} periods of {capture.size // periods}; split each "
            "capture into its periods, as snapshots"
        )
    order, per_chip = candidates[0]
    length = 2**order - 1
    # The sum over a chip is its matched filter; decimation without it would alias noise. The phase that begins with the
    # chips holds the most energy.
    sums = np.sum([np.roll(capture, -k) for k in range(per_chip)], axis=0).reshape(length, per_chip).T
    spectrum = fft(sums[np.argmax(np.sum(np.abs(sums) ** 2, axis=1))].astype(np.complex64))
    base = m_sequence(order, PRIMITIVE_POLYNOMIALS[order])
    base_spectrum = np.conj(fft(1.0 - 2.0 * base)).astype(np.complex64)
    index = np.arange(length)
    peaks: list[tuple[float, int, complex]] = []
    for decimation in _coset_leaders(order):
        # decimation of a sequence by d decimates its spectrum by 1/d
        reference = base_spectrum[(pow(decimation, -1, length) * index) % length]
        correlation = ifft(spectrum * reference)
        peak = np.argmax(np.abs(correlation))
        peaks.append((float(np.abs(correlation[peak])), decimation, complex(correlation[peak])))
    peaks.sort(key=lambda peak: -peak[0])
    (best, decimation, value), (second, *_) = peaks[:2]
    margin = 20 * np.log10(best / second) if second > 0 else 0.0
    if not margin >= minimum_margin:  # NaN included
        raise DataError(
            f"no m-sequence of order {order} stands out: the best is {margin:.1f} dB above the next, "
            f"expected at least {minimum_margin:g} dB; is this a back-to-back capture?"
        )
    found = _characteristic_polynomial(base[(decimation * index) % length], order)
    reciprocal = tuple(order - exponent for exponent in reversed(found))
    polynomial, direction = min((found, "forward"), (reciprocal, "reversed"))
    return Identification(
        order=order,
        samples_per_chip=per_chip,
        polynomial=polynomial,
        direction="forward" if direction == "forward" else "reversed",
        polarity="positive" if value.real >= 0 else "negative",
        margin=float(margin),
    )


def _periods(capture: NDArray[np.complex128]) -> int:
    """Periods that a capture holds: K of them have power in every K-th line of the spectrum alone.

    An m-sequence has all lines, so a share of 1 - 1/K of its power lies between those. Noise lies between them too;
    half of that share is the bound.
    """
    power = np.abs(np.fft.fft(capture)) ** 2
    power[0] = 0.0  # the receiver's offset
    total = power.sum()
    for periods in (4, 3, 2):
        if capture.size % periods == 0 and total - power[::periods].sum() < (1 - 1 / periods) / 2 * total:
            return periods
    return 1


# One for each order; the others follow by decimation. Source: Peterson & Weldon, 1972, table C.2.
PRIMITIVE_POLYNOMIALS: dict[int, tuple[int, ...]] = {
    7: (7, 1, 0),
    8: (8, 4, 3, 2, 0),
    9: (9, 4, 0),
    10: (10, 3, 0),
    11: (11, 2, 0),
    12: (12, 6, 4, 1, 0),
    13: (13, 4, 3, 1, 0),
    14: (14, 5, 3, 1, 0),
    15: (15, 1, 0),
}


@cache
def _coset_leaders(order: int) -> tuple[int, ...]:
    """Smallest member of each cyclotomic coset that is prime to the length; each stands for one sequence."""
    length = 2**order - 1
    leaders = []
    for d in range(1, length, 2):
        coset = [(d << shift) % length for shift in range(order)]
        if d == min(coset) and np.gcd(d, length) == 1:
            leaders.append(d)
    return tuple(leaders)


def _characteristic_polynomial(bits: NDArray[np.int8], order: int) -> tuple[int, ...]:
    """Exponents of the polynomial that generates the sequence, by Gaussian elimination over GF(2)."""
    rows = np.array([[*bits[n : n + order], bits[n + order]] for n in range(order)], dtype=np.uint8)
    for column in range(order):
        pivot = column + int(np.argmax(rows[column:, column]))
        rows[[column, pivot]] = rows[[pivot, column]]
        for row in range(order):
            if row != column and rows[row, column]:
                rows[row] ^= rows[column]
    return (order, *(exponent for exponent in range(order - 1, -1, -1) if rows[exponent, order]))
