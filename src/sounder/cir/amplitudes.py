"""Histograms of samples: a signal has a tail, a converter or an amplifier that limits it makes a wall."""

import numpy as np

from sounder.recordings.recording import Captures

NEAR = 0.01
"""Distance from the largest amplitude that counts as close to it, relative to it."""
WALL = 0.02
"""Share of samples close to the largest amplitude that makes a wall. Noise, and chips behind a band limit, have at most
0.6 % there; a limiter at the root mean square has 18 % or more. Chosen between."""
MIN_LEVELS = 50
"""Fewest levels between zero and the largest number for a wall to be told from a coarse converter's last step."""
LARGEST = float(np.finfo(np.float32).max) ** 0.25
"""Largest sample: the square of its power is a number in single precision. Twice the full scale of 32 bits."""


def within_range(captures: Captures) -> bool:
    """Whether all samples are numbers whose powers can be computed with.

    Examples
    --------
    >>> within_range(np.array([[3e4, 2j]])), within_range(np.array([[np.nan, 0]])), within_range(np.array([[1e10]]))
    (True, False, False)
    """
    return captures.dtype.kind == "i" or bool((np.abs(captures) < LARGEST).all())


def amplitude_wall(capture: Captures) -> float:
    """Share of the samples whose amplitude is close to the largest.

    Parameters
    ----------
    capture : array int16 (sample, iq) or complex64 (sample,)

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = (rng.normal(size=(1022, 2)) @ [1, 1j]).astype(np.complex64)
    >>> amplitude_wall(noise) < WALL < amplitude_wall(noise / np.maximum(np.abs(noise), 1.4))
    True
    """
    parts = _parts(capture)
    return _near_largest(np.hypot(parts[0], parts[1]))


def component_wall(capture: Captures) -> float:
    """Share of the numbers I, or of Q, that are close to their largest; the larger share of the two.

    It is 0 for a coarse converter, which has fewer than `MIN_LEVELS` levels up to the largest number.

    Parameters
    ----------
    capture : array int16 (sample, iq) or complex64 (sample,)
    """
    parts = _parts(capture)
    share = max(_near_largest(part) for part in parts)
    if share > WALL and max(np.unique(part).size for part in parts) < MIN_LEVELS:
        return 0.0
    return share


def _parts(capture: Captures) -> np.ndarray:
    """Magnitudes of I and Q (2, sample)."""
    if capture.dtype.kind == "c":
        return np.abs(np.stack([capture.real, capture.imag]))
    return np.abs(capture.T.astype(np.float32))


def _near_largest(amplitude: np.ndarray) -> float:
    largest = amplitude.max()
    return float(np.mean(amplitude >= (1 - NEAR) * largest)) if largest > 0 else 0.0
