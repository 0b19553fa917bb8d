"""Histograms of samples: a signal has a tail, a converter or an amplifier that limits it makes a wall."""

import numpy as np
from numpy.typing import NDArray

from erm.common.significance import FALSE_ALARM
from sounder.kernels.correlation.reference import as_complex
from sounder.recordings.recording import Captures

NEAR = 0.01
"""Distance from the largest amplitude that counts as close to it, relative to it."""
WALL = 0.02
"""Share of samples close to the largest amplitude that makes a wall. Noise, and chips behind a band limit, have at most
0.6 % there; a limiter at the root mean square has 18 % or more. Chosen between."""
DELAYS = 8
"""Fractions of a sample at which a capture is looked at for the wall that the sequence makes by itself."""
LAST_VALUES = 8
"""Values next to the last one with which its frequency is compared. Chosen; not derived."""
LARGEST = float(np.finfo(np.float32).max) ** 0.25
"""Largest sample: the square of its power is a number in single precision. Twice the full scale of 32 bits."""


def within_range(captures: Captures) -> bool:
    """Whether all samples are numbers whose powers can be computed with.

    Examples
    --------
    >>> within_range(np.array([[3e4, 2j]])), within_range(np.array([[np.nan, 0]])), within_range(np.array([[1e10]]))
    (True, False, False)
    """
    return captures.dtype.kind == "i" or float(np.abs(captures).max(initial=0)) < LARGEST


def amplitude_wall(capture: Captures | NDArray[np.complex128]) -> float:
    """Share of the samples whose amplitude is close to the largest.

    Parameters
    ----------
    capture : array int16 (sample, iq) or complex (sample,)

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = (rng.normal(size=(1022, 2)) @ [1, 1j]).astype(np.complex64)
    >>> amplitude_wall(noise) < WALL < amplitude_wall(noise / np.maximum(np.abs(noise), 1.4))
    True
    """
    amplitude = np.abs(as_complex(capture))
    largest = amplitude.max()
    return float(np.mean(amplitude >= (1 - NEAR) * largest)) if largest > 0 else 0.0


def wall_of_sequence(captures: Captures | NDArray[np.complex128]) -> float:
    """Largest wall that the transmitted sequence makes by itself, at any delay.

    Chips that are shorter than the instrument's response have a tail of amplitudes. Rectangular ones have plateaus, and
    how many samples lie on them depends on the fraction of a sample by which the path is late.

    Parameters
    ----------
    captures : array int16 (snapshot, sample, iq) or complex (snapshot, sample)
        Captures of one strong path: a back-to-back.

    Returns
    -------
    float
        Largest `amplitude_wall` of their mean, delayed by `DELAYS` fractions of a sample.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> chips = np.sign(rng.normal(size=511)).repeat(2)
    >>> limited = np.fft.ifft(np.fft.fft(chips) * (np.abs(np.fft.fftfreq(1022)) < 0.25))
    >>> wall_of_sequence(limited[None]) < 0.01, wall_of_sequence(chips[None] + 0j)
    (True, 1.0)
    """
    spectrum = np.fft.fft(as_complex(captures).mean(axis=0))
    turn = -2j * np.pi * np.fft.fftfreq(spectrum.size)
    return max(amplitude_wall(np.fft.ifft(spectrum * np.exp(turn * k / DELAYS))) for k in range(DELAYS))


def rail(captures: Captures, tests: int) -> tuple[float, float]:
    """Share of the numbers at the ends of the range that they take, and the bound on it [1].

    The histogram of samples has tails. With a density that falls toward the end, each of the ``k`` values next to the
    last is at least as frequent as the last; of the ``n`` samples at these ``k + 1`` values the last has at most a
    share of ``1 / (k + 1)``. A converter or a conversion that limits piles samples up on the last one.

    Parameters
    ----------
    captures : array int16 (..., sample, iq) or complex (..., sample)
    tests : int
        Tests that share `FALSE_ALARM`.
    """
    from scipy.special import bdtrik

    numbers = captures.reshape(-1) if captures.dtype.kind != "c" else captures.view(captures.real.dtype).reshape(-1)
    values, counts = np.unique(numbers, return_counts=True)
    if values.size < 2 * LAST_VALUES:
        return 0.0, 1.0
    worst, least = 0, 0.0
    for end in (counts[: LAST_VALUES + 1], counts[: -LAST_VALUES - 2 : -1]):
        others = int(end.sum()) - 1  # the last value was met at least once
        allowed = 1 + float(np.ceil(bdtrik(1 - FALSE_ALARM / tests / 2, others, 1 / (LAST_VALUES + 1))))
        if end[0] > allowed and end[0] > worst:
            worst, least = int(end[0]), allowed
    return (worst / numbers.size, least / numbers.size) if worst else (0.0, 1.0)
