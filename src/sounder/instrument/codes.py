"""Codes and other sequences that repeat, by name."""

import numpy as np
from numpy.typing import NDArray

from sounder.instrument.waveform import m_sequence

GPS_DELAYS = (
    5, 6, 7, 8, 17, 18, 139, 140, 141, 251, 252, 254, 255, 256, 257, 258,
    469, 470, 471, 472, 473, 474, 509, 512, 513, 514, 515, 516, 859, 860, 861, 862,
)  # fmt: skip
"""Delay of the second sequence of the C/A code of PRN 1 to 32 [chips]; IS-GPS-200, table 3-Ia."""
GPS_POLYNOMIALS = (10, 3, 0), (10, 9, 8, 6, 3, 2, 0)
"""Those of both sequences, G1 and G2."""

Complex = NDArray[np.complex128]


def gold(order: int, first: tuple[int, ...], second: tuple[int, ...], shift: int) -> Complex:
    """Gold code: the product of two m-sequences, the second ``shift`` chips late (chip,); a 0 is sent as +1.

    References
    ----------
    R. Gold, "Optimal binary sequences for spread spectrum multiplexing", IEEE Trans. Inf. Theory 13, 1967.
    """
    bits = _register(order, first) ^ np.roll(_register(order, second), shift)
    return (1.0 - 2.0 * bits).astype(complex)


def gps_ca(prn: int) -> Complex:
    """C/A code of a GPS satellite (1023,); IS-GPS-200.

    Examples
    --------
    The first ten chips of PRN 1 are 1440 in octal:

    >>> "".join(str(int(chip.real < 0)) for chip in gps_ca(1)[:10])
    '1100100000'
    """
    return gold(10, *GPS_POLYNOMIALS, GPS_DELAYS[prn - 1])


def zadoff_chu(length: int, root: int) -> Complex:
    """``exp(-j pi u n (n + N mod 2) / N)`` (length,), of constant modulus and with an ideal autocorrelation.

    References
    ----------
    D. C. Chu, "Polyphase codes with good periodic correlation properties", IEEE Trans. Inf. Theory 18, 1972.
    """
    n = np.arange(length)
    return np.exp(-1j * np.pi * root * n * (n + length % 2) / length)


def chirp(samples: int, cycles: float) -> Complex:
    """Linear sweep over ``cycles`` lines of the spectrum about the carrier (samples,)."""
    n = np.arange(samples)
    return np.exp(1j * np.pi * cycles * (n**2 / samples - n) / samples)


def multitone(samples: int, tones: int) -> Complex:
    """Tones at the lines about the carrier, without the carrier, with Newman's phases (samples,).

    References
    ----------
    D. J. Newman, "An L1 extremal problem for polynomials", Proc. AMS 16, 1965; S. Boyd, IEEE Trans. CAS 33, 1986.
    """
    below = tones // 2
    lines = np.concatenate([np.arange(-below, 0), np.arange(1, tones - below + 1)])
    spectrum = np.zeros(samples, complex)
    spectrum[lines] = np.exp(1j * np.pi * np.arange(tones) ** 2 / tones)
    return np.fft.ifft(spectrum) * samples / np.sqrt(tones)


def _register(order: int, polynomial: tuple[int, ...]) -> NDArray[np.int8]:
    """Shift register whose last stage is sent, all stages 1 at first; the taps are counted from the input.

    A register of feedback ``1 + x^3 + x^10``, as GPS describes it, obeys ``s[n + 10] = s[n + 7] xor s[n]``: the
    reciprocal of the polynomial that `m_sequence` takes.
    """
    return m_sequence(order, tuple(sorted((order - exponent for exponent in polynomial), reverse=True)))
