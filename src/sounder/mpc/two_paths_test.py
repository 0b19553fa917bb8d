"""Whether beams hold one path at a delay, or two."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.two_paths_fit import AZIMUTH, DELAY, ELEVATION, LEVEL, Beams, Sight, fit, linearised
from sounder.mpc.two_paths_posterior import posterior

Real = NDArray[np.float64]

ABOUT = 3.0
"""How far from their middle beams are for a first fit, in beamwidths."""
KNOWN = 0.01, 0.02
"""Relative errors of the pattern that are allowed for: of the gain, and of the lobe's width."""
CRITERION = 20.0
"""Squared residuals, in variances, by which two paths must fit better than one: five unknowns in a hundred numbers."""
FITS = 3.0
"""Deviations of the squared residuals by which two paths may fit worse than noise."""
LEAST = 0.6
"""Least distance of two paths in beamwidths: two at that make a lobe 12 % wider, more than horns differ by."""
MARGIN = 2.0
"""Amplitude over the pattern's prediction that still counts as the same path (6 dB, for horns not as measured)."""
SPAN, GRID = 2.5, 0.25
"""Directions that fits start from, about that of one path, and their distance, in beamwidths."""
APART, FURTHEST = 0.5, 3
"""Steps of the distance between them, in beamwidths; the best start in each of so many is followed."""
TURNS = 6
"""Phases between two paths, in half a circle."""
RATIOS = 0.5, 1.0, 2.0
"""Of their amplitudes, to start from."""
LOUD = 5.0
"""Power of a beam, in noise powers, from which its residuals are judged."""
TINY = 1e-6
"""Information that makes a matrix regular without telling anything."""
EXPLORE, SETTLE = 6, 10
"""Most steps of fits from all starts to the beams about them, and from the best of each phase to all beams."""


@dataclass(frozen=True)
class Two:
    """Two paths.

    Attributes
    ----------
    paths : array (2, 4)
    covariance : array (8, 8)
        Of the four parameters of each in turn.
    misfit : float
        Residual power over that of the noise.
    """

    paths: Real
    covariance: Real
    misfit: float


@dataclass(frozen=True)
class One:
    """A path that does not explain the magnitudes.

    Attributes
    ----------
    path : array (4,)
    cost : float
    size : array (beam,)
        Magnitudes at its delay.
    """

    path: Real
    cost: float
    size: Real


def one_misses(path: Real, middle: float, seen: Beams, sight: Sight) -> One | None:
    """Fit one path, outside the fan too; None if it explains the magnitudes of all beams.

    Parameters
    ----------
    path : array (4,)
        As it was found.
    middle : float
        Azimuth about which it may be [degree].
    seen : Beams
    sight : Sight
    """
    vague = _vague(seen)
    if not _misses(path, vague, sight):
        return None
    bounds = sight.bounds(middle, ABOUT - 0.5)
    up = sight.widths[1] * np.array([-1.5, 1.5])
    bounds[:, ELEVATION] += up
    ones = np.repeat(path[None, None], 3, axis=0)
    ones[1:, 0, ELEVATION] = sight.fan + up / 3
    ones, cost, _ = fit(ones, np.zeros(3), vague, sight, bounds, steps=SETTLE)
    best = int(np.argmin(cost))
    path = ones[best, 0]
    return One(path, float(cost[best]), _magnitudes(path, vague, sight)) if _misses(path, vague, sight) else None


def two_fit(one: One, middle: float, seen: Beams, sight: Sight) -> Two | None:
    """Fit two paths instead of one; None unless they fit, clearly better, and their directions are known.

    Parameters
    ----------
    one : One
    middle : float
        Azimuth about which they may be [degree].
    seen : Beams
    sight : Sight
    """
    vague, bounds = _vague(seen), sight.bounds(middle, ABOUT - 0.5)
    near = np.abs(vague.looks[:, 0] - middle) <= ABOUT * sight.widths[0]
    about = Beams(vague.looks[near], vague.noise[near], vague.data[near])
    starts, turns = _starts(one.path, one.size[near], about, sight)
    if not starts.size:
        return None
    paths, costs, _ = fit(starts, turns, about, sight, bounds, steps=EXPLORE)
    paths, costs = paths.reshape(TURNS, -1, 2, 4), costs.reshape(TURNS, -1)
    paths, turns = paths[np.arange(TURNS), np.argmin(costs, axis=1)], turns[:: costs.shape[1]]
    best = int(np.argmin(costs.min(axis=1)))
    if not _agrees(paths[[best]], turns[[best]], about, sight):
        return None
    paths, costs, information = fit(paths, turns, vague, sight, bounds, steps=SETTLE)
    best = int(np.argmin(costs))
    misfit = _agrees(paths[[best]], turns[[best]], vague, sight)
    if not misfit or 2 * (one.cost - costs[best]) < CRITERION:
        return None
    two, covariance = posterior(*_laplace(paths, costs, information), bounds, vague, sight)
    apart = np.hypot(*((two[0] - two[1])[:2] / sight.widths))
    variance = np.diag(covariance).reshape(2, 4)
    unsure = np.sqrt(variance[:, ELEVATION])
    outside = (two[:, ELEVATION] - unsure <= sight.fan[0]) | (two[:, ELEVATION] + unsure >= sight.fan[1])
    vague_azimuth = variance[:, AZIMUTH] > (sight.widths[0] / 2) ** 2
    if apart < LEAST or outside.any() or vague_azimuth.any() or _let_in(two, sight):
        return None
    return Two(two, covariance, misfit)


def _let_in(two: Real, sight: Sight) -> bool:
    """Tell whether a horn unlike its description may let in one of two paths where the other seems to be.

    By `MARGIN` where the pattern is 12 dB down or more; where it is high it is known the better.
    """
    there, here = two[:, :2], two[::-1, :2]
    level = sight.pattern.beam_gain(*there.T, *here.T) / 20 * np.log(10)
    unlike = np.minimum(np.log(MARGIN), -level / 2)
    return bool((two[:, LEVEL] + level + unlike > two[::-1, LEVEL]).any())


def _laplace(paths: Real, costs: Real, information: Real) -> tuple[Real, Real, Real]:
    """Fits in order of azimuth: paths (fit, 2, 4), covariances (fit, 8, 8) and likelihood (fit,), as if Gaussian."""
    swapped = paths[:, 0, AZIMUTH] > paths[:, 1, AZIMUTH]
    paths[swapped] = paths[swapped][:, ::-1]
    turned = np.roll(np.arange(8), 4)
    information[swapped] = information[swapped][:, turned][:, :, turned]
    information = information + TINY * np.eye(8)
    evidence: Real = -costs - 0.5 * np.linalg.slogdet(information)[1]
    share: Real = np.exp(evidence - evidence.max())
    share /= share.sum()
    return paths, np.linalg.inv(information).astype(float), share


def _agrees(paths: Real, phase: Real, seen: Beams, sight: Sight) -> float:
    """Residual power over the noise's, in beams over the noise; 0 if noise alone does not leave so much."""
    _, left, _, _ = linearised(paths, phase, seen, sight)
    size = left.shape[-1]
    strong = np.sum(np.abs(seen.data) ** 2, axis=1) - size > LOUD
    missed = 2 * np.sum(np.abs(left[0, strong]) ** 2)
    freedom = max(int(strong.sum()) * (2 * size - 1) - 9, 1)
    return float(missed / freedom) if missed < freedom + FITS * np.sqrt(2 * freedom) else 0.0


def _magnitudes(one: Real, seen: Beams, sight: Sight) -> Real:
    """Magnitudes (beam,) at the delay of one path."""
    pulse, _ = sight.samples.at(one[DELAY])
    magnitudes: Real = np.abs(seen.data @ pulse.conj()) / np.sum(np.abs(pulse) ** 2) * np.sqrt(seen.noise)
    return magnitudes


def _misses(one: Real, seen: Beams, sight: Sight) -> bool:
    """Tell whether magnitudes over the noise miss one path's pattern by as much as two paths must fit better."""
    pulse, _ = sight.samples.at(one[DELAY])
    energy = np.sum(np.abs(pulse) ** 2) / seen.noise
    size = _magnitudes(one, seen, sight)
    expected = np.exp(one[LEVEL]) * 10 ** (sight.pattern.beam_gain(one[AZIMUTH], one[ELEVATION], *seen.looks.T) / 20)
    loud = energy * np.maximum(size, expected) ** 2 > LOUD
    missed = 2 * np.sum((energy * (size - expected) ** 2)[loud])
    return bool(missed > CRITERION + max(int(loud.sum()) - 9, 0))


def _vague(seen: Beams) -> Beams:
    """Beams with what is not known of the pattern as further noise: of gain, and of width the further down the more."""
    power = np.maximum(np.sum(np.abs(seen.data) ** 2, axis=1) - seen.data.shape[1], 1e-3)
    down = 0.5 * np.log(power.max() / power)
    error = KNOWN[0] + 2 * KNOWN[1] * down
    weight = 1 / np.sqrt(1 + 2 * error**2 * power)
    return Beams(seen.looks, seen.noise / weight**2, seen.data * weight[:, None])


def _starts(one: Real, size: Real, seen: Beams, sight: Sight) -> tuple[Real, Real]:
    """Pairs of directions whose magnitudes at the delay of one path fit best, for each phase between them."""
    up = np.clip(one[ELEVATION], seen.looks[:, 1].min(), seen.looks[:, 1].max())
    toward = one[AZIMUTH] + np.arange(-SPAN, SPAN + GRID / 2, GRID) * sight.widths[0]
    g = 10 ** (sight.pattern.beam_gain(toward[:, None], up, *seen.looks.T) / 20) / np.sqrt(seen.noise)
    i, j = np.triu_indices(toward.size, 1)
    far = (j - i) * GRID >= LEAST
    i, j = i[far], j[far]
    # The best of each distance: neighbours of the very best lead where it leads.
    distance = np.minimum((j - i) * GRID / APART, FURTHEST).astype(int)
    phases = (np.arange(TURNS) + 0.5) * np.pi / TURNS
    ratios = np.array(RATIOS)
    starts = []
    for phase in phases:
        model = np.abs(g[i] + (ratios * np.exp(1j * phase))[:, None, None] * g[j])  # (ratio, pair, beam)
        level = (model @ (size / np.sqrt(seen.noise))) / np.sum(model**2, axis=-1)
        fits = level * (model @ (size / np.sqrt(seen.noise)))  # what it explains of the squares
        ratio = np.argmax(fits, axis=0)
        fits, level = fits.max(axis=0), level[ratio, np.arange(i.size)]
        for kind in np.unique(distance):
            best = np.flatnonzero(distance == kind)[np.argmax(fits[distance == kind])]
            low = np.log(level[best])
            starts.append(
                [
                    [toward[i[best]], up, low, one[DELAY]],
                    [toward[j[best]], up, low + np.log(ratios[ratio[best]]), one[DELAY]],
                ]
            )
    return np.array(starts), np.repeat(phases, len(starts) // TURNS)
