"""Combinations of neighbouring samples whose noise is independent."""

import numpy as np
from numpy.typing import NDArray

RANK = 1e-3
"""Share of the most noise under which a combination of samples holds none."""


def whitener(noise: NDArray[np.float64], size: int) -> NDArray[np.complex128]:
    """Combinations (combination, sample) of samples, of unit noise in each for noise of power 1 a sample.

    Parameters
    ----------
    noise : array (sample,)
        Density of the noise, mean 1.
    size : int
        Samples combined.
    """
    lags = np.arange(size)
    together = np.fft.ifft(noise)[lags[:, None] - lags]
    value, vector = np.linalg.eigh(together)
    kept = value > RANK * value.max()
    return np.asarray((vector[:, kept] / np.sqrt(value[kept])).conj().T)
