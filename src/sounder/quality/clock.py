"""What the clock does over a scan, from delays of paths in overlapping beams: lost samples, and drift."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from erm.common.significance import FALSE_ALARM
from sounder.quality.beams import MIN_BEAMS
from sounder.quality.delays import UNRESOLVED, WINDOW, Delays

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

ALIKE = 0.3
"""Difference of delays that counts as none [sample]: that of whole samples from what lies halfway, and some noise."""
STEPS = 5
"""Points a sample at which the delay of a path is tried, closer than `ALIKE`."""
LEAST_GAIN = 10
"""Delays that a loss must make agree. One agrees by chance in one of 18, 0.6 of 11 samples; for `FALSE_ALARM` over a
thousand places and shifts five must. Those of neighbours are not independent: twice as many."""
DRIFT_FALSE_ALARM = FALSE_ALARM / 100
"""Probability of a drift by chance: the standard error of few paths is too small more often than it should be."""
LEAST_DRIFT = 0.1
"""Smallest drift over the scan that is removed [sample]: eight times that of clocks which walk by a picosecond
a direction over 108 directions."""


def lost_samples(delays: Delays, order: Integers) -> tuple[int, int]:
    """Number of the direction from which on samples are missing, and how many; (0, 0) if none are.

    After a loss of ``-s`` samples before direction ``f`` the beams that see a path agree about one delay ``t`` before
    ``f``, and about ``t + s`` from there on. Over all paths, the number of delays that agree,

        ``sum_p max_t #{b: |d_pb - t - s [n_b >= f]| < ALIKE}``,

    is largest for the right pair (consensus; Fischler and Bolles, Comm. ACM 24, 1981). It must exceed that without a
    loss by `LEAST_GAIN`, by half of what shifts of each path's own would gain (reflections off the ground are later in
    the lower elevation, but by another amount for each path), and by what any drift of the clock would gain.

    Parameters
    ----------
    delays : Delays
    order : array (beam,)
        Number of each beam in the order of the scan.

    Returns
    -------
    first : int
        Number in the order of the scan.
    shift : int
        Delay of all later directions [sample].
    """
    number = order[delays.beam]
    shifts = np.array([shift for shift in range(-WINDOW + 1, WINDOW) if shift])
    grid = np.arange(-2 * WINDOW * STEPS, 2 * WINDOW * STEPS + 1)
    later = np.clip(grid + grid[-1] + STEPS * shifts[:, None], 0, grid.size - 1)
    gain, most = np.zeros((shifts.size, order.size + 1), np.int64), np.zeros(order.size + 1, np.int64)
    together = [np.abs(delays.delay[delays.path == p, None] - grid / STEPS) < ALIKE for p in np.unique(delays.path)]
    if sum(len(agree) - agree.sum(axis=0).max() for agree in together) <= LEAST_GAIN:
        return 0, 0  # more can not be gained than do not agree
    for path, unordered in zip(np.unique(delays.path), together, strict=True):
        own = number[delays.path == path]
        agree = unordered[np.argsort(own)]
        early = np.vstack([np.zeros_like(grid), np.cumsum(agree, axis=0)])
        late = early[-1] - early
        before = np.searchsorted(np.sort(own), np.arange(order.size + 1))
        without = early[-1].max()
        gain += (np.max(early[:, None, :] + late[:, later], axis=-1) - without)[before].T
        most += (early.max(axis=-1) + late.max(axis=-1) - without)[before]
    best, first = np.unravel_index(gain.argmax(), gain.shape)
    found = gain[best, first] > max(LEAST_GAIN, most[first] / 2)
    found = found and gain[best, first] > _gain_by_drift(delays, number / order.size)
    return (int(first), int(shifts[best])) if found else (0, 0)


def _gain_by_drift(delays: Delays, when: Real) -> int:
    """More delays that agree if a drift over the scan is removed; ``when`` (delay,) is their share of the scan."""
    grid = np.arange(-2 * WINDOW * STEPS, 2 * WINDOW * STEPS + 1) / STEPS
    drift = grid[np.abs(grid) < WINDOW]
    count = np.zeros(drift.size, np.int64)
    for path in np.unique(delays.path):
        own = delays.path == path
        late = delays.delay[own, None] - when[own, None] * drift
        count += np.max(np.sum(np.abs(late[..., None] - grid) < ALIKE, axis=0), axis=-1)
    return int(count.max() - count[drift == 0].item())


def clock_drift(delays: Delays, order: Integers) -> tuple[float, float]:
    """Drift of the clock from a direction of the scan to the next, and its bound [sample].

    Least squares with a delay ``t_p`` of each path, ``d = t_p + drift n``, for the delay ``d`` in the beam with the
    number ``n`` in the scan, with Huber's weights. What a beam adds to the error is common to its paths: the standard
    error is that of the sums of the beams (Liang and Zeger, Biometrika 73, 1986), the bound a quantile of Student's
    distribution. Paths that are not resolved make delays depend on azimuth and elevation as a drift may, by up to
    `UNRESOLVED`: where the bound of the drift over the scan is larger, nothing is said, and it is infinite.
    """
    number = order[delays.beam].astype(float)
    weight = np.ones(number.size)
    beams = np.unique(delays.beam).size
    slope = 0.0
    for _ in range(5):
        share = np.maximum(np.bincount(delays.path, weight), np.finfo(float).tiny)
        away, late = (
            values - (np.bincount(delays.path, weight * values) / share)[delays.path]
            for values in (number, delays.delay)
        )
        total = np.sum(weight * away**2)
        if not total or beams <= MIN_BEAMS:
            return 0.0, np.inf
        slope = float(np.sum(weight * away * late) / total)
        residual = late - slope * away
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-3)
        scores = np.bincount(delays.beam, weight * away * residual)
        weight = np.minimum(1, 1.5 * scale / np.maximum(np.abs(residual), 1e-9))
    error = float(np.sqrt(np.sum(scores**2) * beams / (beams - 2)) / total)
    bound = error * -float(stdtrit(beams - 2, DRIFT_FALSE_ALARM))
    return slope, bound if bound * order.size < UNRESOLVED else np.inf
