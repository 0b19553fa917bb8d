"""Detection threshold: the least power of a peak that counts as a path."""

import numpy as np
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.false_alarm import noise_margin
from sounder.options import Threshold

RESIDUAL_RANGE = 75.0
"""How far under the strongest sample the remainders of cancelled paths lie [dB]; the pulse's table is good to 80 dB."""


def detection_threshold(
    cir: NDArray[np.complexfloating],
    noise: NDArray[np.float64],
    threshold: Threshold,
    *,
    independent: float,
    looks: int = 1,
) -> NDArray[np.float64]:
    """Detection threshold of every beam.

    Parameters
    ----------
    cir : array (beam, delay)
        CIRs; NaN where nothing was recorded.
    noise : array (beam,)
        Mean noise power.
    threshold : Threshold
        Its delay gate is not used here: later paths are found and subtracted as well.
    independent, looks
        As for :func:`sounder.cir.false_alarm.noise_margin`.

    Returns
    -------
    array (beam,)
        Least power of a peak: the higher of noise + margin and strongest sample - ``dynamic_range``, which is at most
        :data:`RESIDUAL_RANGE`; infinite where nothing was recorded.

    Examples
    --------
    >>> cir = np.array([[1e-3, 1e-6], [1e-5, 1e-6]])
    >>> noise = np.array([1e-12, np.nan])
    >>> threshold = detection_threshold(cir, noise, Threshold(noise_margin=12.0), independent=2)
    >>> (10 * np.log10(threshold)).round(1)
    array([-108.,   inf])
    """
    recorded = np.isfinite(noise)
    strongest = float(np.max(np.abs(cir), where=np.isfinite(cir), initial=0.0)) ** 2
    under_strongest = strongest * 10 ** (-min(threshold.dynamic_range, RESIDUAL_RANGE) / 10)
    cells = int(recorded.sum()) * cir.shape[1]
    margin = 10 ** (noise_margin(threshold, cells, independent, looks) / 10)
    return np.where(recorded, np.maximum(under_strongest, noise * margin), np.inf)


def independent_samples(filter_: Deembedding) -> float:
    """Independent noise samples of a period: ``sum(S)^2 / sum(S^2)`` of their spectral density ``S``."""
    return float(filter_.noise.sum() ** 2 / np.sum(filter_.noise**2))
