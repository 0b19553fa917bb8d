"""Detection threshold: the least power of a peak that counts as a path."""

import numpy as np
from numpy.typing import NDArray

from sounder.options import Threshold

DYNAMIC_RANGE = 75.0
"""How far under the strongest sample the remainders of cancelled paths lie [dB]; the pulse's table is good to 80 dB."""


def detection_threshold(
    cir: NDArray[np.complexfloating], noise: NDArray[np.float64], rule: Threshold
) -> NDArray[np.float64]:
    """Detection threshold of every beam.

    Parameters
    ----------
    cir : array (beam, delay)
        CIRs; NaN where nothing was recorded.
    noise : array (beam,)
        Mean noise power.
    rule : {"usc", "nyu"}
        ``usc``: noise floor + 12 dB, and no less than `DYNAMIC_RANGE` under the strongest sample (Gomez-Ponce et al.).
        ``nyu``: the higher of strongest sample - 25 dB and noise floor + 5 dB (Sun et al.).

    Returns
    -------
    array (beam,)
        Least power of a peak; infinite where nothing was recorded.

    Examples
    --------
    >>> cir = np.array([[1e-3, 1e-6], [1e-5, 1e-6]])
    >>> threshold = detection_threshold(cir, np.array([1e-12, np.nan]), "usc")
    >>> (10 * np.log10(threshold)).round(1)
    array([-108.,   inf])
    """
    strongest = float(np.max(np.abs(cir), where=np.isfinite(cir), initial=0.0)) ** 2
    if rule == "usc":
        level = np.maximum(strongest * 10 ** (-DYNAMIC_RANGE / 10), noise * 10**1.2)
    else:
        level = np.maximum(strongest * 10**-2.5, noise * 10**0.5)
    return np.where(np.isfinite(noise), level, np.inf)
