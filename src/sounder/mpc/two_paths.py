"""Two paths at one delay in neighbouring beams: told from one by the shape of their sum.

A fit of one path to the beams about it takes two, half a beamwidth to two of them apart, for one between them or for
two of wrong directions, since each disturbs the beams of the other. If the phase between two paths is the same in all
directions, as it is when the horn turns about its phase centre, the magnitudes of all beams have few unknowns and tell
(`sounder.mpc.two_paths_fit`). Whether the phase is the same, no one says beforehand: where two paths are is judged for
both cases (`sounder.mpc.two_paths_posterior`), and they are accepted where

* one fits worse than noise and what is not known of the pattern explain (Bayes' information criterion);
* two fit within the noise, which three paths do not, nor some pairs whose phase turns from beam to beam;
* they are further apart than what a lobe broader than described could be taken for, both are inside the fan, and
  their directions are known.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.matched_filter import OVERSAMPLING
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import columns
from sounder.mpc.fitted import turn, write_path
from sounder.mpc.pattern_slopes import Cuts
from sounder.mpc.two_paths_fit import AZIMUTH, DELAY, ELEVATION, LEVEL, SAMPLES, Beams, Samples, Sight
from sounder.mpc.two_paths_test import Two, one_misses, two_fit

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

TOGETHER = 0.5
"""Delays of MPCs that may be two paths' at one [sample]."""
ASIDE = 3.0
"""Directions of such, in beamwidths."""
LOBE, LEFTOVER = 1.5, 0.1
"""Beams in which other MPCs are known, in beamwidths, and amplitude that is left of them there, relative."""
MOST = 8
"""Fits of two paths at a position, the strongest MPCs first: where one path seldom fits, neither do two."""


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
) -> tuple[Real, NDArray[np.complexfloating], Integers]:
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
    taken : array complex (mpc, beam)
        Of the first of a pair what was taken for both, of the second nothing.
    pair : array (mpc,)
        Number of the pair, -1 for others.
    """
    recorded = np.flatnonzero(np.isfinite(noise))
    up = looks[recorded, 1]
    fan = np.array([up.min() - widths[1] / 2, up.max() + widths[1] / 2]) if up.size else np.zeros(2)
    sight = Sight(Samples.of(filter_.matched_filter, filter_.noise), pattern, widths, fan, Cuts.of(pattern))
    spread = filter_.matched_filter.delay_variance
    kept, pair, pairs, sums, tries = np.ones(len(found), bool), np.full(len(found), -1), [], [], 0
    for group in _groups(found, widths[0]):
        strongest = found[group[0]]
        aside = turn(found[group, columns.AZIMUTH] - strongest[columns.AZIMUTH])
        middle = strongest[columns.AZIMUTH] + (aside.min() + aside.max()) / 2
        first = int(np.floor(strongest[columns.DELAY] + 0.5))
        late = (found[:, columns.DELAY] - first + beams.shape[1] / 2) % beams.shape[1] - beams.shape[1] / 2
        late[group] = np.inf
        power = (noise + _remains(late, found, taken, looks, widths[0]))[recorded]
        data = _restored(first, recorded, late, taken, beams, filter_) @ sight.samples.whitener.T
        around = looks[recorded].copy()
        around[:, 0] = middle + turn(around[:, 0] - middle)
        seen = Beams(around, power, data / np.sqrt(power)[:, None])
        one = one_misses(_path(strongest, middle, first), middle, seen, sight)
        if one is None:
            continue
        two = two_fit(one, middle, seen, sight)
        rows = None if two is None else _rows(two, first, seen, sight, threshold[recorded], recorded, spread)
        if rows is not None:
            kept[group] = False
            pairs.append(rows)
            sums += [taken[group].sum(axis=0), np.zeros_like(taken[0])]
        tries += 1
        if tries == MOST:
            break
    if pairs:
        found, taken = np.concatenate([found[kept], *pairs]), np.concatenate([taken[kept], sums])
        pair = np.concatenate([pair[kept], np.repeat(np.arange(len(pairs)), 2)])
    return found, taken, pair


def _path(row: Real, middle: float, first: int) -> Real:
    """Parameters of a fit from a row of `found`."""
    path = np.empty(4)
    path[AZIMUTH] = middle + turn(row[columns.AZIMUTH] - middle)
    path[ELEVATION], path[LEVEL] = row[columns.ELEVATION], np.log(row[columns.AMPLITUDE])
    path[DELAY] = row[columns.DELAY] - first
    return path


def _groups(found: Real, width: float) -> Iterator[Integers]:
    """MPCs that may be parts of two paths at one delay, strongest first."""
    left = np.argsort(-found[:, columns.AMPLITUDE] * found[:, columns.OFF_BORESIGHT])
    while left.size:
        row = found[left[0]]
        late = np.abs(found[left, columns.DELAY] - row[columns.DELAY]) < TOGETHER
        aside = np.abs(turn(found[left, columns.AZIMUTH] - row[columns.AZIMUTH])) < ASIDE * width
        yield left[late & aside]
        left = left[~(late & aside)]


def _remains(late: Real, found: Real, taken: NDArray[np.complexfloating], looks: Real, width: float) -> Real:
    """Power (beam,) that MPCs at about the delay may have left in each beam: little of what a main lobe lets in."""
    others = np.flatnonzero(np.abs(late) < SAMPLES)
    aside = np.abs(turn(looks[:, 0] - found[others, columns.AZIMUTH, None]))
    share = np.where(aside < LOBE * width, LEFTOVER, 1.0)
    power: Real = np.sum((share * np.abs(taken[others])) ** 2, axis=0)
    return power


def _restored(
    first: int,
    which: Integers,
    late: Real,
    taken: NDArray[np.complexfloating],
    beams: NDArray[np.complexfloating],
    filter_: Deembedding,
) -> NDArray[np.complex128]:
    """Samples (beam, sample) about a delay, less the MPCs that arrive so much later; infinite for those to stay."""
    pulse = filter_.matched_filter.pulse
    samples = np.arange(-SAMPLES, SAMPLES + 1)
    data = beams[np.ix_(which, (first + samples) % beams.shape[1])].astype(complex)
    others = np.flatnonzero(np.abs(late) < pulse.size / OVERSAMPLING / 2 + SAMPLES)
    place = np.rint((samples - late[others, None]) * OVERSAMPLING).astype(int) + pulse.size // 2
    inside = (place >= 0) & (place < pulse.size)
    shapes = np.where(inside, pulse[np.where(inside, place, 0)], 0)
    data -= taken[np.ix_(others, which)].T @ shapes
    return data


def _rows(
    two: Two,
    first: int,
    seen: Beams,
    sight: Sight,
    threshold: Real,
    which: Integers,
    spread: float,
) -> Real | None:
    """Write two paths as `found` has them, unless one is under the threshold."""
    rows = np.zeros((2, columns.COLUMNS))
    for p, (row, path) in enumerate(zip(rows, two.paths, strict=True)):
        g = 10 ** (sight.pattern.beam_gain(path[AZIMUTH], path[ELEVATION], *seen.looks.T) / 20)
        best = int(np.argmax(g))
        if (np.exp(path[LEVEL]) * g[best]) ** 2 < threshold[best]:
            return None
        own = two.covariance[4 * p : 4 * p + 4, 4 * p : 4 * p + 4]
        write_path(row, path, own, two.misfit, (which[best], g[best], seen.noise[best] * spread))
        row[columns.DELAY] = first + path[DELAY]
    return rows
