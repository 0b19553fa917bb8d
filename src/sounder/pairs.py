"""Two paths at one delay in neighbouring beams: told from one by the shape of their sum.

A fit of one path to the beams about it takes two, half a beamwidth to two of them apart, for one between them or for
two of wrong directions, since each disturbs the beams of the other. If the phase between two paths is the same in all
directions, as it is when the horn turns about its phase centre, the magnitudes of all beams have few unknowns and tell
(`sounder.pair_fit`). Whether the phase is the same, no one says beforehand; so two paths are accepted where

* one fits worse than noise and what is not known of the pattern explain (Bayes' information criterion);
* two fit within the noise: pairs whose phase turns from beam to beam mostly do not, nor do three paths;
* they are further apart than what a lobe broader than described could be taken for, both are inside the fan, and
  their directions are known.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sounder.antenna import Pattern
from sounder.calibration import Deembedding
from sounder.kernels import component
from sounder.matched import OVER
from sounder.pair_fit import AZIMUTH, DELAY, ELEVATION, LEVEL, SAMPLES, Beams, Samples, fit, linearised

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

TOGETHER = 0.5
"""Delays of MPCs that may be two paths' at one [sample]."""
ASIDE = 3.0
"""Directions of such, in beamwidths."""
ABOUT = 3.0
"""Beams that are fitted, in beamwidths from the strongest."""
KNOWN = 0.01, 0.02
"""Relative errors of the pattern that are allowed for: of the gain, and of the lobe's width."""
CRITERION = 20.0
"""Squared residuals, in variances, by which two paths must fit better than one: five unknowns in a hundred numbers."""
FITS = 3.0
"""Deviations of the squared residuals by which two paths may fit worse than noise."""
LEAST = 0.6
"""Least distance of two paths in beamwidths: two at that make a lobe 12 % wider, more than horns differ by."""
SPAN, GRID = 2.5, 0.25
"""Directions that fits start from, about that of one path, and their distance, in beamwidths."""
APART, FURTHEST = 0.5, 4
"""Steps of the distance between them, in beamwidths; the best start in each of so many is followed."""
TURNS = 8
"""Phases between two paths, in half a circle."""
RATIOS = 0.5, 1.0, 2.0
"""Of their amplitudes, to start from."""
LOUD = 5.0
"""Power of a beam, in noise powers, from which its residuals are judged."""
EXPLORE, SETTLE = 8, 15
"""Most steps of fits from all starts to the beams about them, and from the best of each phase to all beams."""


def split(
    found: Real,
    taken: NDArray[np.complexfloating],
    beams: NDArray[np.complexfloating],
    noise: Real,
    looks: Real,
    widths: tuple[float, float],
    pattern: Pattern,
    filter_: Deembedding,
    threshold: Real,
) -> tuple[Real, Integers]:
    """Replace MPCs by two paths at their delay where these fit, and one does not.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
    taken : array complex (mpc, beam)
        What was taken for each in each beam.
    beams : array complex (beam, delay)
        CIRs.
    noise : array (beam,)
        Noise power; NaN where nothing was recorded.
    looks : array (beam, 2)
        Azimuth and elevation [degree].
    widths : (float, float)
        Half-power beamwidths [degree].
    pattern : Pattern
    filter_ : Deembedding
    threshold : array (beam,)
        Least power of a path.

    Returns
    -------
    found : array (mpc, component.COLUMNS)
    pair : array (mpc,)
        Number of the pair, -1 for others.
    """
    samples = Samples.of(filter_.matched, filter_.noise)
    elevation = looks[:, 1]
    fan = np.array([elevation.min() - widths[1] / 2, elevation.max() + widths[1] / 2])
    kept, pair, pairs = np.ones(len(found), bool), np.full(len(found), -1), []
    for group in _groups(found, widths[0]):
        strongest = found[group[0]]
        aside = _turn(found[group, component.AZIMUTH] - strongest[component.AZIMUTH])
        middle = strongest[component.AZIMUTH] + (aside.min() + aside.max()) / 2
        which = np.flatnonzero(np.isfinite(noise))
        first = int(np.floor(strongest[component.DELAY] + 0.5))
        data = _restored(first, which, group, found, taken, beams, filter_)
        around = looks[which].copy()
        around[:, 0] = middle + _turn(around[:, 0] - middle)
        seen = Beams(around, noise[which], data @ samples.whitener.T / np.sqrt(noise[which])[:, None])
        rows = _two(found[group], middle, first, seen, samples, pattern, widths, fan, threshold[which], which, filter_.matched.delay_variance)
        if rows is not None:
            kept[group] = False
            pairs.append(rows)
    if pairs:
        found = np.concatenate([found[kept], *pairs])
        pair = np.concatenate([pair[kept], np.repeat(np.arange(len(pairs)), 2)])
    return found, pair


def _turn(angle: Real) -> Real:
    return (angle + 180) % 360 - 180


def _groups(found: Real, width: float) -> Iterator[Integers]:
    """MPCs that may be parts of two paths at one delay, strongest first."""
    left = np.argsort(-found[:, component.AMPLITUDE] * found[:, component.OFF_BORESIGHT])
    while left.size:
        row = found[left[0]]
        late = np.abs(found[left, component.DELAY] - row[component.DELAY]) < TOGETHER
        aside = np.abs(_turn(found[left, component.AZIMUTH] - row[component.AZIMUTH])) < ASIDE * width
        yield left[late & aside]
        left = left[~(late & aside)]


def _restored(
    first: int,
    which: Integers,
    group: Integers,
    found: Real,
    taken: NDArray[np.complexfloating],
    beams: NDArray[np.complexfloating],
    filter_: Deembedding,
) -> NDArray[np.complex128]:
    """Samples (beam, sample) about a delay, less all MPCs that are not of the group."""
    pulse = filter_.matched.pulse
    period = beams.shape[1]
    samples = np.arange(first - SAMPLES, first + SAMPLES + 1)
    data = beams[np.ix_(which, samples % period)].astype(complex)
    late = (found[:, component.DELAY] - first + period / 2) % period - period / 2
    others = np.abs(late) < pulse.size / OVER / 2 + SAMPLES
    others[group] = False
    place = np.rint((samples - first - late[others, None]) * OVER).astype(int) + pulse.size // 2
    inside = (place >= 0) & (place < pulse.size)
    shapes = np.where(inside, pulse[np.where(inside, place, 0)], 0)
    data -= taken[np.ix_(others, which)].T @ shapes
    return data


def _two(
    group: Real,
    azimuth: float,
    first: int,
    seen: Beams,
    samples: Samples,
    pattern: Pattern,
    widths: tuple[float, float],
    fan: Real,
    threshold: Real,
    which: Integers,
    spread: float,
) -> Real | None:
    """Rows of two paths, if they and not one fit."""
    reach = (ABOUT - 0.5) * widths[0]
    bounds = np.array([[azimuth - reach, fan[0], -60.0, -1.0], [azimuth + reach, fan[1], 60.0, 1.0]])
    single = np.array([azimuth, 0.0, 0.0, group[0, component.DELAY] - first])
    single[AZIMUTH] += _turn(group[0, component.AZIMUTH] - azimuth)
    single[ELEVATION], single[LEVEL] = group[0, component.ELEVATION], np.log(group[0, component.AMPLITUDE])
    vague = _vague(seen)
    if not _misses(single, vague, samples, pattern):
        return None
    beyond = bounds + np.array([[0.0, -1.5 * widths[1], 0.0, 0.0], [0.0, 1.5 * widths[1], 0.0, 0.0]])
    ones = np.repeat(single[None, None], 3, axis=0)
    ones[1:, 0, ELEVATION] = fan + 0.5 * widths[1] * np.array([-1, 1])
    ones, cost, _ = fit(ones, np.zeros(3), vague, samples, pattern, beyond, steps=SETTLE)
    one, cost = ones[[np.argmin(cost)]], cost.min(keepdims=True)
    if not _misses(one[0, 0], vague, samples, pattern):
        return None
    size = _magnitudes(one[0, 0], vague, samples)
    near = np.abs(vague.looks[:, 0] - azimuth) <= ABOUT * widths[0]
    about = Beams(vague.looks[near], vague.noise[near], vague.data[near])
    starts, turns = _starts(one[0, 0], size[near], about, pattern, widths[0])
    paths, costs, _ = fit(starts, turns, about, samples, pattern, bounds, steps=EXPLORE)
    paths, costs = paths.reshape(TURNS, -1, 2, 4), costs.reshape(TURNS, -1)
    paths, turns = paths[np.arange(TURNS), np.argmin(costs, axis=1)], turns[:: costs.shape[1]]
    best = int(np.argmin(costs.min(axis=1)))
    if not _agrees(paths[[best]], turns[[best]], about, samples, pattern):
        return None
    paths, costs, information = fit(paths, turns, vague, samples, pattern, bounds, steps=SETTLE)
    best = int(np.argmin(costs))
    misfit = _agrees(paths[[best]], turns[[best]], vague, samples, pattern)
    if not misfit or 2 * (cost[0] - costs[best]) < CRITERION:
        return None
    two, covariance = _mean(paths, costs, information)
    apart = np.hypot(*((two[0] - two[1])[:2] / widths))
    variance = np.diag(covariance)
    unsure = np.sqrt(variance[[ELEVATION, 4 + ELEVATION]])
    outside = (two[:, ELEVATION] - unsure <= fan[0]) | (two[:, ELEVATION] + unsure >= fan[1])
    if apart < LEAST or outside.any() or (variance[[AZIMUTH, 4 + AZIMUTH]] > (widths[0] / 2) ** 2).any():
        return None
    return _rows(group[0], two, covariance, misfit, first, seen, pattern, threshold, which, spread)


def _mean(paths: Real, costs: Real, information: Real) -> tuple[Real, Real]:
    """Mean (path, 4) and covariance (8, 8) of two paths over the phase between them, all of it alike beforehand.

    At each phase the likelihood is taken for Gaussian (Laplace); it is not along the phase, at whose ends the
    magnitudes do not change with it.
    """
    swapped = paths[:, 0, AZIMUTH] > paths[:, 1, AZIMUTH]
    paths[swapped] = paths[swapped][:, ::-1]
    turned = np.roll(np.arange(8), 4)
    information[swapped] = information[swapped][:, turned][:, :, turned]
    evidence = -costs - 0.5 * np.linalg.slogdet(information)[1]
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    flat = paths.reshape(-1, 8)
    mean = weight @ flat
    away = flat - mean
    covariance = np.einsum("s,sij->ij", weight, np.linalg.inv(information)) + (away * weight[:, None]).T @ away
    return mean.reshape(2, 4), covariance


def _agrees(paths: Real, phase: Real, seen: Beams, samples: Samples, pattern: Pattern) -> float:
    """Residual power over the noise's, in beams over the noise; 0 if noise alone does not leave so much."""
    _, left, _, _ = linearised(paths, phase, seen, samples, pattern)
    size = left.shape[-1]
    strong = np.sum(np.abs(seen.data) ** 2, axis=1) - size > LOUD
    missed = 2 * np.sum(np.abs(left[0, strong]) ** 2)
    freedom = max(int(strong.sum()) * (2 * size - 1) - 9, 1)
    return float(missed / freedom) if missed < freedom + FITS * np.sqrt(2 * freedom) else 0.0


def _magnitudes(one: Real, seen: Beams, samples: Samples) -> Real:
    """Magnitudes (beam,) at the delay of one path."""
    pulse, _ = samples.at(one[DELAY])
    magnitudes: Real = np.abs(seen.data @ pulse.conj()) / np.sum(np.abs(pulse) ** 2) * np.sqrt(seen.noise)
    return magnitudes


def _misses(one: Real, seen: Beams, samples: Samples, pattern: Pattern) -> bool:
    """Tell whether magnitudes over the noise miss one path's pattern by as much as two paths must fit better."""
    pulse, _ = samples.at(one[DELAY])
    energy = np.sum(np.abs(pulse) ** 2) / seen.noise
    size = _magnitudes(one, seen, samples)
    expected = np.exp(one[LEVEL]) * 10 ** (pattern.beam_gain(one[AZIMUTH], one[ELEVATION], *seen.looks.T) / 20)
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


def _starts(one: Real, size: Real, seen: Beams, pattern: Pattern, width: float) -> tuple[Real, Real]:
    """Pairs of directions whose magnitudes at the delay of one path fit best, for each phase between them."""
    up = np.clip(one[ELEVATION], seen.looks[:, 1].min(), seen.looks[:, 1].max())
    toward = one[AZIMUTH] + np.arange(-SPAN, SPAN + GRID / 2, GRID) * width
    g = 10 ** (pattern.beam_gain(toward[:, None], up, *seen.looks.T) / 20) / np.sqrt(seen.noise)
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


def _rows(
    strongest: Real,
    two: Real,
    covariance: Real,
    misfit: float,
    first: int,
    seen: Beams,
    pattern: Pattern,
    threshold: Real,
    which: Integers,
    spread: float,
) -> Real | None:
    """Write two paths as `found` has them, unless one is under the threshold."""
    rows = np.zeros((2, component.COLUMNS))
    for p, (row, path) in enumerate(zip(rows, two, strict=True)):
        g = 10 ** (pattern.beam_gain(path[AZIMUTH], path[ELEVATION], *seen.looks.T) / 20)
        best = int(np.argmax(g))
        amplitude = np.exp(path[LEVEL])
        if (amplitude * g[best]) ** 2 < threshold[best]:
            return None
        own = covariance[4 * p : 4 * p + 4, 4 * p : 4 * p + 4]
        row[component.DELAY] = first + path[DELAY]
        row[component.AZIMUTH], row[component.ELEVATION], row[component.AMPLITUDE] = *path[:2], amplitude
        row[component.VAR_AZIMUTH], row[component.VAR_ELEVATION] = own[AZIMUTH, AZIMUTH], own[ELEVATION, ELEVATION]
        row[component.VAR_AMPLITUDE] = own[LEVEL, LEVEL] * amplitude**2
        row[component.AZIMUTH_ELEVATION] = own[AZIMUTH, ELEVATION]
        row[component.AZIMUTH_AMPLITUDE] = own[AZIMUTH, LEVEL] * amplitude
        row[component.ELEVATION_AMPLITUDE] = own[ELEVATION, LEVEL] * amplitude
        row[component.MISFIT], row[component.BEAM], row[component.OFF_BORESIGHT] = misfit, which[best], g[best]
        row[component.ENERGY] = seen.noise[best] * spread / (amplitude**2 * own[DELAY, DELAY])
    return rows
