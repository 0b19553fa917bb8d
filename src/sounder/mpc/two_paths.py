"""Two paths of one delay in neighbouring beams, which look like one path of a wrong direction.

Two paths half a beamwidth to two beamwidths apart, fitted one at a time, become one path between them, or two in wrong
directions, since each disturbs the beams of the other. If the phase between two paths is the same in
all directions, as it is when the horn turns about its phase centre, the magnitudes of all beams have few unknowns and
show both (`sounder.mpc.two_paths_fit`). It is not known beforehand whether the phase is the same. So the directions
are estimated for both cases (`sounder.mpc.two_paths_posterior`), and two paths are accepted where

* one fits worse than noise and the error of the pattern explain (Bayes' information criterion);
* two fit within the noise, which three paths do not, nor some pairs whose phase changes from beam to beam;
* they are further apart than a lobe broader than described could explain, both are inside the fan, and their
  directions are known.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sounder.kernels.extraction.records import PATH
from sounder.mpc.directions import wrap
from sounder.mpc.fit_parameters import AZIMUTH, DELAY, ELEVATION, LEVEL, set_path
from sounder.mpc.scan import CANCELLATION_RESIDUAL, Scan
from sounder.mpc.two_paths_decision import TwoPaths, find_two_paths, poor_single_path
from sounder.mpc.two_paths_fit import PARAMETERS
from sounder.mpc.whitened_samples import PADDING, BeamSamples

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating]
Integers = NDArray[np.int64]
Paths = NDArray[np.record]

MAX_DELAY_DIFFERENCE = 0.5
"""MPCs closer than this may be two paths of one delay [sample]; chosen, not derived."""
MAX_AZIMUTH_DIFFERENCE = 3.0
"""And closer than this in azimuth [beamwidth]."""
LOBE = 1.5
"""Beams this close to an MPC are in its main lobe, where little is left of it [beamwidth]."""
MAX_FITS = 8
"""Fits of two paths at a position, the strongest MPCs first: where one path seldom fits, neither do two."""


def split_paths(found: Paths, removed: Complex, scan: Scan) -> tuple[Paths, Complex, Integers]:
    """Replace MPCs by two paths of their delay where these fit and one does not.

    Parameters
    ----------
    found : array of `PATH` (mpc,)
    removed : array complex (mpc, beam)
        Amplitude that cancellation removed for each MPC from each beam.
    scan : Scan

    Returns
    -------
    found : array of `PATH` (mpc,)
        With the pairs at the end.
    removed : array complex (mpc, beam)
        For the first of a pair what was removed for both, for the second nothing.
    group : array (mpc,)
        Number of the pair, -1 for other MPCs.
    """
    kept, pairs, sums, fits = np.ones(len(found), bool), [], [], 0
    for members in _groups(found, scan.beamwidth[0]):
        strongest = found[members[0]]
        aside = wrap(found["azimuth"][members] - strongest["azimuth"])
        middle = strongest["azimuth"] + (aside.min() + aside.max()) / 2
        first = int(np.floor(strongest["delay"] + 0.5))
        late = scan.delay_after(found["delay"], first)
        late[members] = np.inf
        beams = _samples(first, middle, late, found, removed, scan)
        vague = beams.with_pattern_error(*scan.antenna.pattern_error)
        one = poor_single_path(_parameters(strongest, middle, first), middle, vague, scan)
        if one is None:
            continue
        two = find_two_paths(one, middle, vague, scan)
        pair = None if two is None else _records(two, first, vague, scan)
        if pair is not None:
            kept[members] = False
            pairs.append(pair)
            sums += [removed[members].sum(axis=0), np.zeros_like(removed[0])]
        fits += 1
        if fits == MAX_FITS:
            break
    group = np.append(np.full(kept.sum(), -1), np.repeat(np.arange(len(pairs)), 2))
    if pairs:
        found, removed = np.concatenate([found[kept], *pairs]), np.concatenate([removed[kept], sums])
    return found, removed, group


def _parameters(path: np.record, middle: float, first: int) -> Real:
    """Parameters (4,) of a path found, with its azimuth near ``middle`` and its delay after ``first``."""
    parameters = np.empty(PARAMETERS)
    parameters[AZIMUTH] = middle + wrap(path["azimuth"] - middle)
    parameters[ELEVATION], parameters[LEVEL] = path["elevation"], np.log(path["amplitude"])
    parameters[DELAY] = path["delay"] - first
    return parameters


def _groups(found: Paths, beamwidth: float) -> Iterator[Integers]:
    """MPCs that may be parts of two paths of one delay, strongest first."""
    left = np.argsort(-found["amplitude"] * found["beam_gain"])
    while left.size:
        strongest = found[left[0]]
        near = np.abs(found["delay"][left] - strongest["delay"]) < MAX_DELAY_DIFFERENCE
        near &= np.abs(wrap(found["azimuth"][left] - strongest["azimuth"])) < MAX_AZIMUTH_DIFFERENCE * beamwidth
        yield left[near]
        left = left[~near]


def _samples(first: int, middle: float, late: Real, found: Paths, removed: Complex, scan: Scan) -> BeamSamples:
    """Samples of the recorded beams about a delay, without the MPCs that arrive ``late`` after it (infinite: to stay).

    What cancellation may have left of these counts as noise.
    """
    samples = np.arange(-PADDING, PADDING + 1)
    data = scan.cir[np.ix_(scan.recorded, (first + samples) % scan.period)].astype(complex)
    others = scan.overlaps(late, -PADDING, PADDING)
    data -= removed[np.ix_(others, scan.recorded)].T @ scan.pulse_at(samples - late[others, None])
    noise = (scan.noise + _residual_power(late, found, removed, scan))[scan.recorded]
    directions = scan.directions[scan.recorded]
    directions[:, 0] = middle + wrap(directions[:, 0] - middle)
    return BeamSamples(directions, noise, data @ scan.centred_pulse.whitener.T / np.sqrt(noise)[:, None])


def _residual_power(late: Real, found: Paths, removed: Complex, scan: Scan) -> Real:
    """Power (beam,) that MPCs about the delay may have left in each beam: little in the beams of their main lobe."""
    others = np.flatnonzero(np.abs(late) < PADDING)
    aside = np.abs(wrap(scan.directions[:, 0] - found["azimuth"][others, None]))
    share = np.where(aside < LOBE * scan.beamwidth[0], CANCELLATION_RESIDUAL, 1.0)
    power: Real = np.sum((share * np.abs(removed[others])) ** 2, axis=0)
    return power


def _records(two: TwoPaths, first: int, beams: BeamSamples, scan: Scan) -> Paths | None:
    """Records of two paths, unless one is under the threshold."""
    pair = np.zeros(2, PATH)
    for p, parameters in enumerate(two.paths):
        g = 10 ** (scan.pattern.beam_gain(parameters[AZIMUTH], parameters[ELEVATION], *beams.directions.T) / 20)
        best = int(np.argmax(g))
        beam = scan.recorded[best]
        if (np.exp(parameters[LEVEL]) * g[best]) ** 2 < scan.threshold[beam]:
            return None
        block = slice(PARAMETERS * p, PARAMETERS * (p + 1))
        set_path(
            pair[p],
            parameters,
            two.covariance[block, block],
            misfit=max(1.0, two.misfit) * beams.noise[best] / scan.noise[beam],
            beam=beam,
            beam_gain=g[best],
            unit_delay_variance=scan.noise[beam] * scan.filter_.matched_filter.delay_variance,
        )
        pair[p]["delay"] = first + parameters[DELAY]
    return pair
