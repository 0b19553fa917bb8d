"""Delays of one path in overlapping beams: lost samples, slips of single directions, drift of the clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from erm.common.significance import FALSE_ALARM
from sounder.quality.beams import AGREEMENT, MAIN_LOBE, MIN_BEAMS, Neighbours, Paths

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

WINDOW = 5
"""Samples to either side of a path's peak in which other beams are searched for it."""
SEEN = 30.0
"""Power over the noise of a peak whose delay is used: 15 dB."""
CLOSE = 2
"""The same for single directions that slipped, which is rarely by more than a sample."""
NEAR = 0.3
"""Difference of delays that counts as none, or as a whole number of samples [sample]."""
SIDELOBES = 6.0
"""Difference from the usual power in sidelobes beyond which a beam sees something else [dB]: they are known to 6 dB."""
UNRESOLVED = 0.2
"""Error of the delay of a path beside weak ones that are not resolved [sample]: of one 14 dB below, a sample off."""
SIGMAS = 3.0
"""Standard errors that a delay may be off."""
MIN_PAIRS = 30
"""Pairs of beams that must show lost samples."""
MOVED = 0.75
"""Share of the pairs across a loss that must differ by it, and of those that differ by it that must be across."""
MIN_MOVED = 0.1
"""Least share of the delays that differ from their path's median after a loss; it saves time where nothing differs."""
FAR_SEEN = 8
"""Strongest paths whose delays are measured in all beams; chosen."""
DRIFT_FALSE_ALARM = FALSE_ALARM / 100
"""Probability of a drift by chance: the standard error of few paths is too small more often than it should be."""
LEAST_DRIFT = 0.1
"""Smallest drift over the scan that is removed [sample]: eight times that of clocks which walk by a picosecond
a direction over 108 directions."""


@dataclass(frozen=True)
class Delays:
    """Delays of paths in beams.

    Attributes
    ----------
    path, beam : array (delay,)
        Numbers of the path and of the beam.
    delay : array (delay,)
        Against the peak in the path's strongest beam [sample].
    tolerance : array (delay,)
        Error that noise and other paths make [sample].
    far : array (delay,)
        Whether the beam is far from the path and sees it through its sidelobes.
    """

    path: Integers
    beam: Integers
    delay: Real
    tolerance: Real
    far: NDArray[np.bool_]

    def against_path(self, offset: Real) -> Real:
        """Delays (delay,) against the median over the beams of a path, with the offsets (beam,) removed."""
        own = self.delay - offset[self.beam]
        middle = np.zeros(int(self.path.max(initial=-1)) + 1)
        for number in np.unique(self.path):
            middle[number] = np.median(own[self.path == number])
        against: Real = own - middle[self.path]
        return against

    def pairs(self) -> tuple[Integers, Integers, Integers]:
        """Pairs of delays of one path: indices of both, and the path."""
        first, second = np.nonzero(np.triu(self.path[:, None] == self.path[None, :], 1))
        return first, second, self.path[first]


def measure_delays(snr: NDArray[np.floating], paths: Paths, near: Neighbours, window: int, *, strict: bool) -> Delays:
    """Delays of the highest peaks about every path's, by a parabola through three samples in dB.

    A Hann-shaped spectrum has a pulse that is a parabola in dB about its peak, to 0.02 samples. With the power
    ``A exp(-k t^2)`` over a noise of the same band, its delay has the variance ``1 / (2 A k)``.

    Parameters
    ----------
    snr : array (beam, delay)
        Power over the noise of the beam.
    paths : Paths
    near : Neighbours
    window : int
        Samples to either side of the peak in which it is searched for.
    strict : bool
        Of the beams about a path, use only those that see it as strong as expected.
    """
    size = snr.shape[1]
    paths = _without_sidelobes(paths, size)
    lag = np.arange(-window - 1, window + 2)
    at = (paths.delay[:, None] + lag) % size
    around, used = paths.around, paths.around >= 0
    if strict:
        used &= paths.agree & paths.consistent[:, None]
    around, used = _with_far_beams(paths, near, used, snr.shape)
    power = snr[np.maximum(around, 0)[..., None], at[:, None, :]]
    inner = power[..., 1:-1]
    peak = inner.argmax(axis=-1) + 1
    left, middle, right = (
        np.log(np.maximum(np.take_along_axis(power, (peak + step)[..., None], axis=-1)[..., 0], 1e-6))
        for step in (-1, 0, 1)
    )
    curvature = left - 2 * middle + right
    is_peak = (middle > left) & (middle >= right) & (middle > np.log(SEEN)) & used
    far = np.arange(around.shape[1]) >= paths.around.shape[1]
    usual = np.ma.median(np.ma.masked_array(middle, ~(is_peak & far)), axis=1).filled(0.0)[:, None]
    is_peak &= ~far | (np.abs(middle - usual) < SIDELOBES * np.log(10) / 10)
    delay = lag[peak] + 0.5 * (left - right) / np.where(curvature < 0, curvature, -1)
    path, beam = np.nonzero(is_peak)
    std = 1 / np.sqrt(np.exp(middle[path, beam]) * -curvature[path, beam])
    tolerance = UNRESOLVED + SIGMAS * std
    return Delays(path, around[path, beam], delay[path, beam].astype(float), tolerance.astype(float), far[beam])


def _without_sidelobes(paths: Paths, size: int) -> Paths:
    """Paths but for those at the delay of a stronger one that are weak enough to be its sidelobes."""
    level = paths.seen[:, 0]
    apart = np.abs(paths.delay[:, None] - paths.delay)
    same = (np.minimum(apart, size - apart) <= CLOSE) & (level[:, None] < level + MAIN_LOBE)
    return paths.take(np.flatnonzero(~same.any(axis=1)))


def _with_far_beams(
    paths: Paths, near: Neighbours, used: NDArray[np.bool_], shape: tuple[int, ...]
) -> tuple[Integers, NDArray[np.bool_]]:
    """Beams of each path, and for the strongest paths all other beams, which see them through their sidelobes.

    Of paths that are close in delay, sidelobes show the strongest, but not in beams about those that see more than it:
    there is another path.
    """
    beams, size = shape
    apart = np.abs(paths.delay[:, None] - paths.delay)
    close = np.minimum(apart, size - apart) < 2 * WINDOW
    shown = np.flatnonzero(~np.tril(close, -1).any(axis=1))[:FAR_SEEN]
    lobe = np.zeros((len(paths.around), beams + 1), bool)
    np.put_along_axis(lobe, paths.around, True, axis=1)
    for path, beam in np.argwhere(_more_than_expected(paths)):
        lobe[path, near.beam[paths.around[path, beam]]] = True
    seen = np.zeros((len(lobe), beams), bool)
    seen[shown] = ~lobe[shown, :beams]
    return np.hstack([paths.around, np.tile(np.arange(beams), (len(lobe), 1))]), np.hstack([used, seen])


def lost_samples(delays: Delays, order: Integers) -> tuple[int, int]:
    """Number of the direction from which on samples are missing, and how many; (0, 0) if none are.

    Two beams that see one path have the same delay before and after a loss, and differ by it across.

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
    if np.count_nonzero(np.abs(delays.against_path(np.zeros(order.size))) > NEAR) < MIN_MOVED * delays.delay.size:
        return 0, 0
    one, other, _ = delays.pairs()
    number = order[delays.beam]
    early = np.minimum(number[one], number[other])
    late = np.maximum(number[one], number[other])
    difference = (delays.delay[other] - delays.delay[one]) * np.where(number[other] > number[one], 1, -1)
    same = np.abs(difference) < NEAR
    best, found = 0, (0, 0)
    for shift in range(-WINDOW + 1, WINDOW):
        moved = np.abs(difference - shift) < NEAR
        if shift == 0 or moved.sum() < MIN_PAIRS:
            continue
        # votes for a loss between two directions: +1 from its first to its last possible place
        votes = np.zeros(order.size + 2)
        np.add.at(votes, early + 1, moved.astype(float) - same)
        np.add.at(votes, late + 1, same - moved.astype(float))
        gain = np.cumsum(votes)
        first = int(gain.argmax())
        across = (early < first) & (first <= late)
        explained = np.sum(moved & across) > MOVED * max(moved.sum(), across.sum())
        if gain[first] > max(best, MIN_PAIRS) and explained:
            best, found = int(gain[first]), (first, shift)
    return found


def slips(delays: Delays, beams: int, elevations: int) -> Integers:
    """Delay (beam,) of each beam against the others [sample]; 0 unless it has slipped by a whole number of samples.

    The delay of a path is the median over its beams. A path counts for a beam if most other beams that see it agree; of
    these paths the one about which most agree tells the delay of the beam, and most others, weighted by how many agree
    about them, must not contradict it. A slip by more than a sample must show in as many paths. Two paths that are not
    resolved seldom look like one that is off by a whole sample: the power of both is between their delays. Sidelobes
    show one path alone; in main lobes there may be two: if no beam has slipped that sees a path through its sidelobes,
    two thirds of those that are off, and at least three, must be off by whole samples. Where three or more beams of one
    elevation in the main lobe of a path are off by the same, and no others are, they see a reflection off the ground.
    """
    off, agree, sure = _against_others(delays, beams)
    shifts, far = np.zeros(beams, np.int64), np.zeros(beams, bool)
    suspects = np.unique(delays.beam[sure & (np.abs(off) > 0.5)])
    if 2 * suspects.size > np.unique(delays.beam[sure]).size:  # the others are no reference
        return shifts
    for beam in suspects:
        own = np.flatnonzero(sure & (delays.beam == beam))
        best = own[np.argmax(agree[own])]
        shift = np.rint(off[best])
        fits = np.abs(off[own] - shift) < delays.tolerance[own]
        if fits.sum() >= np.abs(shift) and agree[own][fits].sum() >= MOVED * agree[own].sum():
            shifts[beam], far[beam] = shift, delays.far[best]
    for path in np.unique(delays.path):
        lobe = np.unique(delays.beam[sure & (delays.path == path) & ~delays.far])
        alike = lobe[shifts[lobe] != 0]
        if alike.size >= MIN_BEAMS and np.ptp(shifts[alike]) == 0 and np.ptp(alike % elevations) == 0:
            shifts[alike] = 0
    moved = np.count_nonzero(shifts)
    if not shifts[far].any() and (moved < MIN_BEAMS or 3 * moved <= 2 * suspects.size):
        shifts[:] = 0
    return shifts


def unsettled(delays: Delays, beams: int, elevations: int) -> Real:
    """How far beams (beam,) are off the path about which most others agree, if they agree about none [sample].

    Not those of one elevation that are off in one direction: they see a reflection off the ground.
    """
    off, agree, sure = _against_others(delays, beams)
    figure = np.zeros(beams)
    for beam in np.unique(delays.beam[sure]):
        own = np.flatnonzero(sure & (delays.beam == beam))
        if (np.abs(off[own]) > 0.5).all():
            figure[beam] = off[own[np.argmax(agree[own])]]
    for path in np.unique(delays.path):
        lobe = np.unique(delays.beam[sure & (delays.path == path) & ~delays.far])
        for sign in (-1, 1):
            alike = lobe[sign * figure[lobe] > 0]
            if alike.size >= MIN_BEAMS and np.ptp(alike % elevations) == 0:
                figure[alike] = 0
    return figure


def _against_others(delays: Delays, beams: int) -> tuple[Real, Integers, NDArray[np.bool_]]:
    """Delays against the median of their paths, how many other beams agree, and whether these are most of the others.

    A delay that does not tell whole samples apart is not sure either.
    """
    off = delays.against_path(np.zeros(beams))
    settled = np.abs(off) < delays.tolerance
    count = np.bincount(delays.path)[delays.path]
    agree = np.bincount(delays.path, settled)[delays.path].astype(np.int64) - settled
    return off, agree, (agree >= MIN_BEAMS) & (agree >= MOVED * (count - 1)) & (delays.tolerance < 0.5)


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
    bound = error * float(student.isf(DRIFT_FALSE_ALARM, beams - 2))
    return slope, bound if bound * order.size < UNRESOLVED else np.inf


def _more_than_expected(paths: Paths) -> NDArray[np.bool_]:
    """Beams (path, near) about a consistent path that see more than it."""
    return paths.consistent[:, None] & paths.clear & (paths.seen > paths.expected + AGREEMENT)
