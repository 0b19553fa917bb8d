"""Whether beams hold one path at a delay, or two."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.fit_parameters import AZIMUTH, AZIMUTH_GRID, DELAY, ELEVATION, LEVEL, REGULARISATION
from sounder.mpc.scan import Scan
from sounder.mpc.several_paths import aligned, responses
from sounder.mpc.two_paths_fit import PARAMETERS, PHASES, fit_paths, with_phase
from sounder.mpc.two_paths_posterior import posterior
from sounder.mpc.whitened_samples import MAX_OFFSET, BeamSamples

Real = NDArray[np.float64]

AZIMUTH_SPAN = 2.5
"""How far from the azimuth of one path two paths may be, and their fits start [beamwidth]; chosen, not derived."""
NEAR_BEAMS = AZIMUTH_SPAN + 0.5
"""Beams of the first fits: how far from their middle azimuth [beamwidth]."""
PAIR_IMPROVEMENT = 20.0
"""Least decrease of the squared residuals, in variances, from one path to two: five unknowns in a hundred numbers
(Bayes' information criterion)."""
PAIR_EXCESS = 3.0
"""Standard deviations by which the squared residuals of two paths may exceed those of noise."""
MIN_SEPARATION = 0.6
"""Least distance of two paths [beamwidth]. Two paths at that distance make a lobe 12 % wider, more than horns differ
from their descriptions."""
DISTANCE_STEP = 0.5
"""Pairs of starts are sorted by their distance in steps of this [beamwidth]; the best of each is followed."""
DISTANCE_CLASSES = 3
"""Number of the last class of distances, which holds all larger ones."""
AMPLITUDE_RATIOS = np.array([0.5, 1.0, 2.0])
"""Ratios of the amplitudes of two paths that fits start from."""
MIN_BEAM_POWER = 5.0
"""Power of a beam, in noise powers, from which its residuals are judged; chosen, not derived."""
MAX_NEAR_STEPS = 6
"""Steps of fits from all starts to the beams about them, at most."""
MAX_ALL_STEPS = 10
"""Steps of the best fit of each phase to all beams, at most."""


@dataclass(frozen=True)
class TwoPaths:
    """Two paths.

    Attributes
    ----------
    paths : array (2, 4)
        In the order of `sounder.mpc.fit_parameters.Parameter`.
    covariance : array (8, 8)
        Of the four parameters of each in turn.
    misfit : float
        Residual power over that of the noise.
    """

    paths: Real
    covariance: Real
    misfit: float


@dataclass(frozen=True)
class OnePath:
    """The best single path, where it does not explain the magnitudes.

    Attributes
    ----------
    path : array (4,)
        In the order of `sounder.mpc.fit_parameters.Parameter`.
    cost : float
    magnitude : array (beam,)
        Magnitudes at its delay.
    """

    path: Real
    cost: float
    magnitude: Real


def poor_single_path(path: Real, middle: float, beams: BeamSamples, scan: Scan) -> OnePath | None:
    """Fit one path, inside the fan or outside; None if it explains the magnitudes of all beams.

    Parameters
    ----------
    path : array (4,)
        As it was found.
    middle : float
        Middle azimuth of the paths found [degree].
    beams : BeamSamples
        With the error of the pattern counted as noise.
    scan : Scan
    """
    if _explains_magnitudes(path, beams, scan):
        return None
    bounds = _bounds(middle, scan)
    beyond = scan.beamwidth[1] * np.array([-1.5, 1.5])
    bounds[:, ELEVATION] += beyond
    starts = np.repeat(path[None, None], 3, axis=0)
    starts[1:, 0, ELEVATION] = scan.fan + beyond / 3
    fits, cost, _ = fit_paths(starts, np.zeros(3), beams, scan, bounds, max_steps=MAX_ALL_STEPS)
    best = int(np.argmin(cost))
    path = fits[best, 0]
    if _explains_magnitudes(path, beams, scan):
        return None
    return OnePath(path, float(cost[best]), _magnitudes(path, beams, scan))


def find_two_paths(one: OnePath, middle: float, beams: BeamSamples, scan: Scan) -> TwoPaths | None:
    """Fit two paths instead of one; None unless they fit, fit clearly better, and their directions are known.

    Parameters
    ----------
    one : OnePath
    middle : float
        Middle azimuth of the paths found [degree].
    beams : BeamSamples
        With the error of the pattern counted as noise.
    scan : Scan
    """
    bounds = _bounds(middle, scan)
    near = np.abs(beams.directions[:, 0] - middle) <= NEAR_BEAMS * scan.beamwidth[0]
    near_beams = BeamSamples(beams.directions[near], beams.noise[near], beams.samples[near])
    starts, phases = _starts(one.path, one.magnitude[near], near_beams, scan)
    if not starts.size:
        return None
    paths, costs, _ = fit_paths(starts, phases, near_beams, scan, bounds, max_steps=MAX_NEAR_STEPS)
    paths, costs = paths.reshape(PHASES.size, -1, 2, PARAMETERS), costs.reshape(PHASES.size, -1)
    paths, phases = paths[np.arange(PHASES.size), np.argmin(costs, axis=1)], phases[:: costs.shape[1]]
    best = int(np.argmin(costs.min(axis=1)))
    if _consistent_misfit(paths[best], phases[best], near_beams, scan) is None:
        return None
    paths, costs, information = fit_paths(paths, phases, beams, scan, bounds, max_steps=MAX_ALL_STEPS)
    best = int(np.argmin(costs))
    misfit = _consistent_misfit(paths[best], phases[best], beams, scan)
    if misfit is None or 2 * (one.cost - costs[best]) < PAIR_IMPROVEMENT:
        return None
    two, covariance = posterior(*_gaussian_mixture(paths, costs, information), bounds, beams, scan)
    separation = np.hypot(*((two[0] - two[1])[:2] / scan.beamwidth))
    variance = np.diag(covariance).reshape(2, PARAMETERS)
    elevation_std = np.sqrt(variance[:, ELEVATION])
    outside = (two[:, ELEVATION] - elevation_std <= scan.fan[0]) | (two[:, ELEVATION] + elevation_std >= scan.fan[1])
    unknown_azimuth = variance[:, AZIMUTH] > (scan.beamwidth[0] / 2) ** 2
    if separation < MIN_SEPARATION or outside.any() or unknown_azimuth.any() or _may_be_leakage(two, scan):
        return None
    return TwoPaths(two, covariance, misfit)


def _bounds(middle: float, scan: Scan) -> Real:
    """Lower and upper bound (2, 4) of the parameters of a path: about an azimuth, and in the fan."""
    reach = AZIMUTH_SPAN * scan.beamwidth[0]
    lower, upper = scan.fan
    return np.array([[middle - reach, lower, -60.0, -MAX_OFFSET], [middle + reach, upper, 60.0, MAX_OFFSET]])


def _may_be_leakage(two: Real, scan: Scan) -> bool:
    """Whether one path may be leakage of the other, in a horn that differs from its description.

    The real pattern may exceed the described one by a margin where that is 12 dB down or more, and by less near the
    peak.
    """
    there, here = two[:, :2], two[::-1, :2]
    level = scan.pattern.beam_gain(*there.T, *here.T) / 20 * np.log(10)
    margin = np.minimum(np.log(scan.pattern_margin), -level / 2)
    return bool((two[:, LEVEL] + level + margin > two[::-1, LEVEL]).any())


def _gaussian_mixture(paths: Real, costs: Real, information: Real) -> tuple[Real, Real, Real]:
    """Fits in order of azimuth: paths (fit, 2, 4), covariances (fit, 8, 8), probabilities (fit,) (Laplace)."""
    swapped = paths[:, 0, AZIMUTH] > paths[:, 1, AZIMUTH]
    paths[swapped] = paths[swapped][:, ::-1]
    order = np.roll(np.arange(2 * PARAMETERS), PARAMETERS)
    information[swapped] = information[swapped][:, order][:, :, order]
    information = information + REGULARISATION * np.eye(2 * PARAMETERS)
    evidence: Real = -costs - 0.5 * np.linalg.slogdet(information)[1]
    share: Real = np.exp(evidence - evidence.max())
    share /= share.sum()
    return paths, np.linalg.inv(information).astype(float), share


def _consistent_misfit(paths: Real, phase: float, beams: BeamSamples, scan: Scan) -> float | None:
    """Residual power over that of the noise, in beams over the noise; None if noise does not leave so much."""
    fitted = with_phase(paths[None], np.array([phase]))[0]
    model = responses(fitted, beams, scan.centred_pulse, scan.cuts).sum(axis=0)
    rotated, known = aligned(model, beams)
    residual = known[:, None] * rotated - model
    size = residual.shape[1]
    strong = np.sum(np.abs(beams.samples) ** 2, axis=1) - size > MIN_BEAM_POWER
    squares = 2 * np.sum(np.abs(residual[strong]) ** 2)
    freedom = max(int(strong.sum()) * (2 * size - 1) - 9, 1)
    return float(squares / freedom) if squares < freedom + PAIR_EXCESS * np.sqrt(2 * freedom) else None


def _magnitudes(path: Real, beams: BeamSamples, scan: Scan) -> Real:
    """Magnitudes (beam,) at the delay of a path."""
    pulse, _ = scan.centred_pulse.at(path[DELAY])
    output = np.abs(beams.samples @ pulse.conj())
    magnitudes: Real = output / np.sum(np.abs(pulse) ** 2) * np.sqrt(beams.noise)
    return magnitudes


def _explains_magnitudes(path: Real, beams: BeamSamples, scan: Scan) -> bool:
    """Whether one path explains the magnitudes of beams over the noise, to within what two paths must improve."""
    pulse, _ = scan.centred_pulse.at(path[DELAY])
    energy = np.sum(np.abs(pulse) ** 2) / beams.noise
    magnitude = _magnitudes(path, beams, scan)
    toward = scan.pattern.beam_gain(path[AZIMUTH], path[ELEVATION], *beams.directions.T)
    expected = np.exp(path[LEVEL]) * 10 ** (toward / 20)
    strong = energy * np.maximum(magnitude, expected) ** 2 > MIN_BEAM_POWER
    squares = 2 * np.sum((energy * (magnitude - expected) ** 2)[strong])
    return not squares > PAIR_IMPROVEMENT + max(int(strong.sum()) - 9, 0)


def _starts(path: Real, magnitude: Real, beams: BeamSamples, scan: Scan) -> tuple[Real, Real]:
    """Pairs of paths (start, 2, 4) whose magnitudes at the delay of one path fit best, and phases (start,)."""
    elevation = np.clip(path[ELEVATION], beams.directions[:, 1].min(), beams.directions[:, 1].max())
    azimuth = (
        path[AZIMUTH] + np.arange(-AZIMUTH_SPAN, AZIMUTH_SPAN + AZIMUTH_GRID / 2, AZIMUTH_GRID) * scan.beamwidth[0]
    )
    g = 10 ** (scan.pattern.beam_gain(azimuth[:, None], elevation, *beams.directions.T) / 20) / np.sqrt(beams.noise)
    i, j = np.triu_indices(azimuth.size, 1)
    far = (j - i) * AZIMUTH_GRID >= MIN_SEPARATION
    i, j = i[far], j[far]
    # The best of each distance: neighbours of the very best lead where it leads.
    distance = np.minimum((j - i) * AZIMUTH_GRID / DISTANCE_STEP, DISTANCE_CLASSES).astype(int)
    starts = []
    for phase in PHASES:
        model = np.abs(g[i] + (AMPLITUDE_RATIOS * np.exp(1j * phase))[:, None, None] * g[j])  # (ratio, pair, beam)
        inner = model @ (magnitude / np.sqrt(beams.noise))
        amplitude = inner / np.sum(model**2, axis=-1)
        explained = amplitude * inner
        ratio = np.argmax(explained, axis=0)
        explained, amplitude = explained.max(axis=0), amplitude[ratio, np.arange(i.size)]
        for kind in np.unique(distance):
            best = np.flatnonzero(distance == kind)[np.argmax(explained[distance == kind])]
            level = np.log(amplitude[best])
            starts.append(
                [
                    [azimuth[i[best]], elevation, level, path[DELAY]],
                    [azimuth[j[best]], elevation, level + np.log(AMPLITUDE_RATIOS[ratio[best]]), path[DELAY]],
                ]
            )
    return np.array(starts), np.repeat(PHASES, len(starts) // PHASES.size)
