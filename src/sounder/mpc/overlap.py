"""How much less is known of a path when others arrive in the same beams within its pulse."""

import numpy as np
from numpy.typing import NDArray

from sounder.kernels.extraction import columns
from sounder.mpc.cramer_rao import Band
from sounder.mpc.uncertainty import Seen

REACH = 6.0
"""Samples between two paths from which on neither knows of the other: three chips."""

Real = NDArray[np.float64]


def widening(
    found: Real,
    snr: Real,
    seen: Seen,
    band: Band,
    rate: float,
    pair: NDArray[np.int64],
) -> Real:
    """Variances of delay and of magnitudes, over those of the path alone.

    In direction ``b`` a path has the spectrum ``a p``, of unit energy ``p``, and a neighbour ``q`` of unknown phase is
    interference of power ``r_qb`` and shape ``s_q``. With ``S = [p, s_1, ...]`` and ``L_b = diag(0, 1/r_1b, ...)``,

    ``var(a_b) = [(S^H S + L_b)^-1]_00``,  ``1 / var(delay) = sum_b g_b^2 p'^H (I - S (S^H S + L_b)^-1 S^H) p'``,

    for the amplitude of the path itself is unknown too, and ``p'`` is the derivative by delay. How wrong the
    neighbours' delays are is left out.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
    snr : array (mpc,)
        Most power of each over that of the noise, toward boresight [1].
    seen : Seen
        From :func:`sounder.mpc.uncertainty.beams_seeing`.
    band : Band
    rate : float
        Samples a second, the unit of the delays found [Hz].
    pair : array (mpc,)
        Number of the pair that was fitted together, -1 for others: their errors hold each other already.

    Returns
    -------
    array (mpc, 2)
        At least 1, of delay and of magnitudes.

    References
    ----------
    Scharf, Statistical Signal Processing, 1991, section 6.5.
    """
    wider = np.ones((len(found), 2))
    delay, size = found[:, columns.DELAY], band.frequency.size
    late = (delay[None, :] - delay[:, None] + size / 2) % size - size / 2
    close = np.abs(late) < REACH
    close &= (pair[:, None] != pair[None, :]) | (pair < 0) | np.eye(len(found), dtype=bool)
    if close.sum() == len(found):
        return wider
    frequency = 2 * np.pi * band.frequency / rate
    share = np.sqrt(band.density / band.density.sum())
    frequency, share = frequency[share > 0], share[share > 0]
    for p in np.flatnonzero(close.sum(axis=1) > 1):
        others = np.flatnonzero(close[p] & (np.arange(len(found)) != p))
        shapes = share * np.exp(-1j * np.outer(np.append(0.0, late[p, others]), frequency))
        slope = -1j * frequency * shapes[0]
        beams, weight = seen.beam[p], seen.weight[p]
        within = np.zeros((beams.size, others.size + 1))
        within[:, 1:] = 1 / np.maximum(snr[others] * seen.power[others][:, beams].T * band.density.sum(), 1e-12)
        known = np.linalg.inv((shapes.conj() @ shapes.T)[None] + within[:, :, None] * np.eye(others.size + 1))
        along = shapes.conj() @ slope
        full = np.vdot(slope, slope).real
        left = full - np.einsum("i,bij,j->b", along.conj(), known, along).real
        wider[p, 0] = (full - abs(along[0]) ** 2) / (weight @ left)
        wider[p, 1] = 1 / (weight @ (1 / known[:, 0, 0].real))
    return wider
