"""Fit of several paths within a window of delays, with one phase of each for all directions.

The model is that of :mod:`sounder.mpc.several_paths`. The phases of the paths are fitted too, for paths of different
delays determine them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.fit_parameters import REGULARISATION, Parameter
from sounder.mpc.pattern_slopes import Cuts
from sounder.mpc.several_paths import aligned, normal_equations, responses
from sounder.mpc.whitened_samples import BeamSamples, WindowPulse

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

PARAMETERS = len(Parameter)
"""Parameters of a path."""
JOINT_CONVERGENCE = 0.01
"""Decrease of the negative log-likelihood at which a fit ends: a seventh of a standard deviation."""
MAX_STEPS = 30
"""Steps of a fit, at most."""
PHASE_ITERATIONS = 6
"""Alternations between the phases of the paths and those of the directions."""
LOADING = 0.05
"""Energy added to each pulse, relative, so that pulses nearly alike do not cancel with large amplitudes; chosen."""


@dataclass(frozen=True)
class JointFit:
    """Result of a joint fit.

    Attributes
    ----------
    paths : array (path, 5)
        In the order of `sounder.mpc.fit_parameters.Parameter`.
    cost : float
        Negative log-likelihood.
    information : array (parameter, parameter)
        Of the five parameters of each path in turn; singular by one phase common to all.
    misfit : float
        Residual power over that of the noise.
    residual : array complex (beam, combination)
        Rotated to the phases of the paths.
    """

    paths: Real
    cost: float
    information: Real
    misfit: float
    residual: Complex

    @property
    def covariance(self) -> Real:
        """Of the parameters, scaled by the misfit where the residuals exceed the noise."""
        regular = self.information + REGULARISATION * np.eye(len(self.information))
        return np.asarray(max(1.0, self.misfit) * np.linalg.inv(regular))


def fit_jointly(paths: Real, bounds: Real, beams: BeamSamples, window: WindowPulse, cuts: Cuts) -> JointFit:
    """Fit paths by Levenberg-Marquardt from one start.

    Parameters
    ----------
    paths : array (path, 5)
        Start.
    bounds : array (2, path, 5)
        Lower and upper bound of each parameter.
    beams : BeamSamples
        Whitened by ``window``.
    window : WindowPulse
    cuts : Cuts
        Of the antenna.
    """
    lower, upper = bounds.reshape(2, -1)
    paths = np.clip(paths, *bounds)
    damping = 1e-2
    cost, normal, gradient = (of_set[0] for of_set in normal_equations(paths[None], beams, window, cuts))
    for _ in range(MAX_STEPS):
        flat = paths.ravel()
        free = ~(((flat <= lower) & (gradient < 0)) | ((flat >= upper) & (gradient > 0)))
        matrix = normal[np.ix_(free, free)]
        step = np.zeros(flat.size)
        step[free] = np.linalg.solve(matrix + np.diag(damping * np.diag(matrix) + 1e-9), gradient[free])
        trial = np.clip(flat + step, lower, upper).reshape(paths.shape)
        at_trial = [of_set[0] for of_set in normal_equations(trial[None], beams, window, cuts)]
        decrease = cost - at_trial[0]
        if decrease > 0:
            paths, (cost, normal, gradient) = trial, at_trial
        damping *= 0.2 if decrease > 0 else 6.0
        if 0 < decrease < JOINT_CONVERGENCE or damping > 1e6:
            break
    model = responses(paths, beams, window, cuts).sum(axis=0)
    residual = aligned(model, beams)[0] - model
    freedom = max(2 * residual.size - len(residual) - paths.size, 1)
    misfit = float(2 * np.sum(np.abs(residual) ** 2) / freedom)
    return JointFit(paths, float(cost), 2 * normal, misfit, residual)


def best_phases(paths: Real, beams: BeamSamples, window: WindowPulse, cuts: Cuts) -> Real:
    """Phases (path,) to be added that fit best: those of directions and of paths in turn, from the strongest path's."""
    each = responses(paths, beams, window, cuts)
    flat = each.reshape(len(each), -1)
    gram = flat.conj() @ flat.T
    gram += LOADING * np.diag(np.diag(gram).real + 1e-300)
    model = each[np.argmax(np.diag(gram).real)]
    amplitude = np.ones(len(paths), complex)
    for _ in range(PHASE_ITERATIONS):
        rotated, _ = aligned(model, beams)
        amplitude = np.linalg.solve(gram, flat.conj() @ rotated.ravel())
        model = np.einsum("p,pbk->bk", amplitude, each)
    return np.asarray(np.angle(amplitude))
