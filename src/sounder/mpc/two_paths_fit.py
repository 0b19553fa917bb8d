"""Fit of one path or two about a delay, with one phase between the paths.

The model is that of :mod:`sounder.mpc.several_paths`. Pulses of one delay do not determine the phase of the second path
after the first. So it is not fitted: fits are made at several phases, and their likelihoods averaged.
"""

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.fit_parameters import LEVEL, Parameter
from sounder.mpc.scan import Scan
from sounder.mpc.several_paths import normal_equations
from sounder.mpc.whitened_samples import BeamSamples

Real = NDArray[np.float64]

PARAMETERS = len(Parameter) - 1
"""Parameters of a path: all but the phase."""
PHASES = (np.arange(6) + 0.5) * np.pi / 6
"""Phases between two paths for which fits are made and likelihoods averaged: half a circle in six steps."""
LEVEL_SPREAD = np.log(2) / 2
"""Expected difference of the levels of two paths, as a standard deviation: 3 dB, as in most pairs whose sum does not
look like the stronger path alone."""
PAIR_CONVERGENCE = 1e-3
"""Decrease of the negative log-likelihood at which a fit ends; chosen, not derived."""


def fit_paths(
    paths: Real, phase: Real, beams: BeamSamples, scan: Scan, bounds: Real, *, max_steps: int
) -> tuple[Real, Real, Real]:
    """Fit one path or two by Levenberg-Marquardt, from several starts at once.

    Parameters
    ----------
    paths : array (start, path, 4)
        One path or two.
    phase : array (start,)
        Of the second path after the first, kept [radian].
    beams : BeamSamples
    scan : Scan
    bounds : array (2, 4)
        Lower and upper bound of each parameter of a path.
    max_steps : int

    Returns
    -------
    paths : array (start, path, 4)
        The fit from each start.
    cost : array (start,)
        Negative logarithm of likelihood and prior.
    information : array (start, parameter, parameter)
        Fisher information, the four parameters of each path in turn.
    """
    paths = np.clip(paths, *bounds)
    damping = np.full(len(paths), 1e-2)
    cost, normal, gradient = _normal_equations(paths, phase, beams, scan)
    active = np.arange(len(paths))
    for _ in range(max_steps):
        diagonal = np.einsum("sii->si", normal[active])
        damped = normal[active] + (damping[active, None] * diagonal + 1e-9)[:, :, None] * np.eye(diagonal.shape[1])
        step = np.linalg.solve(damped, gradient[active, :, None])[..., 0]
        trial = np.clip(paths[active] + step.reshape(-1, *paths.shape[1:]), *bounds)
        trial_cost, trial_normal, trial_gradient = _normal_equations(trial, phase[active], beams, scan)
        decrease = cost[active] - trial_cost
        better = decrease > 0
        improved = active[better]
        paths[improved], cost[improved] = trial[better], trial_cost[better]
        normal[improved], gradient[improved] = trial_normal[better], trial_gradient[better]
        damping[active] *= np.where(better, 0.2, 8.0)
        if better.any() and decrease.max() < PAIR_CONVERGENCE:
            break
        active = active[~better | (decrease >= PAIR_CONVERGENCE)]
    return paths, cost, 2 * normal


def with_phase(paths: Real, phase: Real) -> Real:
    """Paths (start, path, 5) from their other parameters and the phase (start,) of the second after the first."""
    phases = np.zeros((*paths.shape[:2], 1))
    phases[:, 1:, 0] = phase[:, None]
    return np.concatenate([paths, phases], axis=2)


def _normal_equations(paths: Real, phase: Real, beams: BeamSamples, scan: Scan) -> tuple[Real, Real, Real]:
    """Cost, normal equations and gradient, the prior of the levels included."""
    cost, normal, gradient = normal_equations(with_phase(paths, phase), beams, scan.centred_pulse, scan.cuts)
    fitted = np.flatnonzero(np.arange(gradient.shape[1]) % len(Parameter) < PARAMETERS)
    normal, gradient = normal[:, fitted[:, None], fitted], gradient[:, fitted]
    difference = paths[:, 0, LEVEL] - paths[:, -1, LEVEL]
    if paths.shape[1] > 1:
        _add_level_prior(difference, normal, gradient)
    return cost + 0.5 * np.square(difference) / LEVEL_SPREAD**2, normal, gradient


def _add_level_prior(difference: Real, normal: Real, gradient: Real) -> None:
    """Add to the normal equations that the levels of two paths are expected to be alike."""
    weight = 0.5 / LEVEL_SPREAD**2
    first, second = LEVEL, PARAMETERS + LEVEL
    normal[:, first, first] += weight
    normal[:, second, second] += weight
    normal[:, first, second] -= weight
    normal[:, second, first] -= weight
    gradient[:, first] -= weight * difference
    gradient[:, second] += weight * difference
