"""Direct paths, found without knowing heading, clock or gain.

If an MPC is a direct path, its length minus the distance of the antennas is the error of the clock, and its azimuth
minus the direction of the transmitter is the error of the heading. Every MPC votes for such a pair ``(b, h)``; the pair
on which most antenna pairs agree wins. For antenna pair ``p`` with MPCs ``i``, the likelihood ratio to "no direct path
was received" is::

    l_p = 1 - s + s sum_i w_i E_i N(b_i - b; sigma_b) N(h_i - h; sigma_h) / n

with the share ``s`` of pairs with a direct path, the probability ``w_i`` that a direct path is this MPC of its pair
(most are the first or the strongest one), the agreement ``E_i`` of its elevation with the heights of the antennas, and
the density ``n`` of votes of other paths, uniform over the azimuths and the lengths that the table has. Errors of each
position (of its place, heading and clock) widen ``sigma_b`` and ``sigma_h`` beyond the stated errors; they are
estimated together with ``(b, h)`` by expectation-maximisation from several starts. No path is shorter than the direct
one: each MPC adds ``log(e + (1 - e) Phi((b_i - b) / sigma_b))`` to the evidence, with a small share ``e`` of false
MPCs. The gain is not used except for its order within a pair: direct paths may be obstructed.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs.selection import ELEVATION_STD
from erm.survey.observations import IntArray, Observations

BoolArray = npt.NDArray[np.bool_]

FIRST_AND_STRONGEST = 0.45
"""Probability that a direct path is the first MPC of its pair, and that it is the strongest one; the rest is shared by
all. Chosen."""
LEAST_ELEVATION_AGREEMENT = 0.02
"""Agreement of an elevation that contradicts: all elevations may be wrong. Chosen."""
SPREADS = ((0.0, 0.0), (0.1, 1.0), (0.3, 3.0), (1.0, 5.0))
"""Errors of single positions with which the search starts [m], [degree]; chosen in steps of three."""
USUAL_CLOCK, USUAL_HEADING = 1.0, 5.0
"""Half of the common errors of surveys are below these: 3 ns [m], [degree]. Scales of Cauchy priors; chosen. Errors of
a hundred times as much are found if five paths agree."""
LEAST_EVIDENCE = 5.0
"""Least log-likelihood ratio of each direct path to another path: images agree by chance, but not so well."""
FALSE_MPCS = 0.02
"""Share of MPCs that may be shorter than the direct path: false ones; chosen."""
START_SHARE = 0.6
"""Share of pairs with a direct path with which the search starts; chosen."""
MAX_LINKS = 200
"""Antenna pairs among which candidates are searched: more would not tell more; chosen for time."""
STEPS = 40
"""Most steps of expectation-maximisation."""


class DirectPaths(NamedTuple):
    """A pair (clock, heading) on which direct paths agree."""

    clock: float
    """Measured minus true [m]."""
    heading: float
    """Measured minus true [degree]."""
    clock_spread: float
    heading_spread: float
    """Standard deviations of the errors of single positions, beyond those of the MPCs [m], [degree]."""
    weight: FloatArray
    """Probability (mpc,) that each MPC is a direct path."""
    evidence: float
    """Log-likelihood ratio to a table without direct paths, with the priors."""

    @property
    def number(self) -> float:
        """Expected number of direct paths."""
        return float(self.weight.sum())


def find_direct_paths(seen: Observations, most: int = 8) -> list[DirectPaths]:
    """Find the pairs (clock, heading) on which direct paths agree, the most likely one first.

    Parameters
    ----------
    seen : Observations
        MPCs of all antenna pairs.
    most : int
        Largest number of different pairs.
    """
    if not len(seen.link):
        return []
    votes = _Votes(seen)
    found: list[DirectPaths] = []
    for clock_spread, heading_spread in SPREADS:
        ratio = np.array(
            [
                votes.evidence(votes.clock[i], votes.heading[i], clock_spread, heading_spread, START_SHARE)
                for i in votes.candidates
            ]
        )
        left = np.ones(len(ratio), dtype=bool)
        for _ in range(2 if found else most):
            if not left.any():
                break
            i = votes.candidates[left][np.argmax(ratio[left])]
            found.append(votes.maximise(votes.clock[i], votes.heading[i], clock_spread, heading_spread))
            left &= ~_same(votes.clock[votes.candidates], votes.heading[votes.candidates], found[-1], 4.0)
    found.sort(key=lambda one: -one.evidence)
    distinct: list[DirectPaths] = []
    for one in found:
        if not any(_same(one.clock, one.heading, other, 2.0) for other in distinct):
            distinct.append(one)
    return distinct[:most]


def direct_paths_at(seen: Observations, clock: float, heading: float, spreads: tuple[float, float]) -> DirectPaths:
    """Direct paths near a pair of clock [m] and heading [degree]; none if the votes near it lead away from it.

    Without any, the evidence is that of the prior, and of paths that would be shorter than the direct one.
    """
    votes = _Votes(seen)
    found = votes.maximise(clock, heading, *spreads)
    nothing = votes.evidence(clock, heading, *spreads, 0.0)
    if not _same(clock, heading, found, 4.0) or found.evidence < nothing:
        return DirectPaths(clock, heading, *spreads, np.zeros(len(seen.link)), nothing)
    return found


def latest_clock(seen: Observations) -> float:
    """Clock [m] beyond which more than a few paths would be shorter than the direct one."""
    return float(np.quantile(seen.excess_length + 3 * seen.length_std, FALSE_MPCS))


def one_sided_evidence(seen: Observations) -> float:
    """Log-likelihood ratio to a table without direct paths, from the lengths alone or from the azimuths alone.

    The larger one counts. It is weaker than that of both, but not lost where one of them is wrong.
    """
    votes = _Votes(seen)
    best = 0.0
    for values, std, extent, scale, spreads in (
        (votes.clock, seen.length_std, votes.range, USUAL_CLOCK, {one[0] for one in SPREADS}),
        (votes.heading, seen.azimuth_std, votes.arc, USUAL_HEADING, {one[1] for one in SPREADS}),
    ):
        for spread in spreads:
            total = np.hypot(std, spread)
            for i in votes.candidates:
                away = values - values[i] if values is votes.clock else angle_difference(values, values[i])
                ratio = np.bincount(seen.link, votes.weight * extent * _normal(away, total), minlength=len(seen.tx))
                evidence = np.log(1 - START_SHARE + START_SHARE * ratio).sum() - np.log1p((values[i] / scale) ** 2)
                best = max(best, float(evidence))
    return best


def _same(clock: FloatArray | float, heading: FloatArray | float, found: DirectPaths, sigmas: float) -> BoolArray:
    near = np.abs(np.asarray(clock) - found.clock) < max(sigmas * found.clock_spread, 0.1)
    return near & (np.abs(angle_difference(heading, found.heading)) < max(sigmas * found.heading_spread, 1.0))


class _Votes:
    """Votes of all MPCs for clock and heading."""

    def __init__(self, seen: Observations) -> None:
        self.seen = seen
        self.clock, self.heading = seen.excess_length, seen.excess_azimuth
        links = len(seen.tx)
        first = _extreme(seen.length, seen.link, links) == seen.length
        loudness = np.where(np.isnan(seen.gain), -np.inf, seen.gain)
        strongest = (_extreme(-loudness, seen.link, links) == -loudness) & np.isfinite(loudness)
        weight = FIRST_AND_STRONGEST * (first.astype(float) + strongest)
        weight += (1 - 2 * FIRST_AND_STRONGEST) / np.bincount(seen.link)[seen.link]
        self.range = float(np.ptp(self.clock)) + 10 * USUAL_CLOCK
        self.arc = _arc(seen.azimuth) + 2 * USUAL_HEADING
        deviation = (seen.elevation - seen.direct_elevation[seen.link]) / np.hypot(seen.elevation_std, ELEVATION_STD)
        agreement = np.where(np.isnan(deviation), 1.0, np.exp(-(deviation**2) / 2))
        weight *= np.maximum(agreement, LEAST_ELEVATION_AGREEMENT)
        self.weight = weight
        few = np.unique(np.linspace(0, links - 1, min(links, MAX_LINKS)).astype(int))
        promising = np.isin(seen.link, few) & (first | strongest | (rank(seen.length, seen.link) < 3))
        self.candidates: IntArray = np.flatnonzero(promising)

    def ratios(self, clock: float, heading: float, clock_std: FloatArray, heading_std: FloatArray) -> FloatArray:
        """Likelihood ratio (mpc,) to another path, if the pair has a direct path."""
        length = _normal(self.clock - clock, clock_std) * self.range
        azimuth = _normal(angle_difference(self.heading, heading), heading_std) * self.arc
        return self.weight * length * azimuth

    def stds(self, clock_spread: float, heading_spread: float) -> tuple[FloatArray, FloatArray]:
        """Standard deviations (mpc,) of the votes of direct paths."""
        return np.hypot(self.seen.length_std, clock_spread), np.hypot(self.seen.azimuth_std, heading_spread)

    def evidence(self, clock: float, heading: float, clock_spread: float, heading_spread: float, share: float) -> float:
        """Log-likelihood ratio to a table without direct paths, with the priors."""
        clock_std, heading_std = self.stds(clock_spread, heading_spread)
        ratio = self.ratios(clock, heading, clock_std, heading_std)
        possible = np.log(FALSE_MPCS + (1 - FALSE_MPCS) * ndtr((self.clock - clock) / clock_std)).sum()
        pair = 1 - share + share * np.bincount(self.seen.link, ratio, minlength=len(self.seen.tx))
        prior = np.log1p((clock / USUAL_CLOCK) ** 2) + np.log1p((angle_difference(heading, 0) / USUAL_HEADING) ** 2)
        return float(np.log(pair).sum() + possible - prior)

    def maximise(self, clock: float, heading: float, clock_spread: float, heading_spread: float) -> DirectPaths:
        """Climb to the maximum of the likelihood by expectation-maximisation."""
        share, links = START_SHARE, len(self.seen.tx)
        for _ in range(STEPS):
            clock_std, heading_std = self.stds(clock_spread, heading_spread)
            ratio = share * self.ratios(clock, heading, clock_std, heading_std)
            pair = 1 - share + np.bincount(self.seen.link, ratio, minlength=links)
            weight = ratio / pair[self.seen.link]
            total = weight.sum()
            if not total > 0:
                break
            before = clock, heading
            clock += np.average(self.clock - clock, weights=weight / clock_std**2)
            heading += np.average(angle_difference(self.heading, heading), weights=weight / heading_std**2)
            # a flat prior of one path keeps the spreads away from 0 and 1
            share = (total + 1) / (links + 2)
            clock_spread = _spread(self.clock - clock, self.seen.length_std, weight)
            heading_spread = _spread(angle_difference(self.heading, heading), self.seen.azimuth_std, weight)
            if abs(clock - before[0]) < 1e-5 and abs(heading - before[1]) < 1e-4:
                break
        evidence = self.evidence(clock, heading, clock_spread, heading_spread, share)
        heading = float(angle_difference(heading, 0))
        return DirectPaths(float(clock), heading, clock_spread, heading_spread, weight, evidence)


def _normal(residual: FloatArray, std: FloatArray) -> FloatArray:
    """Probability density of a normal distribution."""
    return np.asarray(np.exp(-((residual / std) ** 2) / 2) / (std * np.sqrt(2 * np.pi)))


def _arc(azimuth: FloatArray) -> float:
    """Smallest arc that holds all azimuths [degree]."""
    ranked = np.sort(azimuth % 360)
    return float(360 - np.max(np.diff(np.r_[ranked, ranked[0] + 360])))


def _spread(residual: FloatArray, std: FloatArray, weight: FloatArray) -> float:
    """Standard deviation of a common error beyond those of the MPCs, by moments."""
    excess = np.sum(weight * (residual**2 - std**2)) / weight.sum()
    return float(np.sqrt(max(excess, 0.0)))


def _extreme(values: FloatArray, link: IntArray, links: int) -> FloatArray:
    """Smallest value (mpc,) of the MPC's antenna pair."""
    least = np.full(links, np.inf)
    np.minimum.at(least, link, values)
    return least[link]


def rank(values: FloatArray, link: IntArray) -> IntArray:
    """Rank (mpc,) within the antenna pair, from the smallest value."""
    order = np.lexsort((values, link))
    starts = np.searchsorted(link[order], np.arange(link.max(initial=-1) + 1))
    rank = np.empty(len(link), dtype=np.int64)
    rank[order] = np.arange(len(link)) - starts[link[order]]
    return rank
