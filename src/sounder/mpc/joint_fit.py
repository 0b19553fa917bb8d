"""Fit of several paths at once to the samples of many beams, with one phase of each for all directions.

In direction ``b`` the samples, whitened, are ``y_b = exp(j psi_b) s_b + n_b`` with

``s_b = sum_p exp(A_p + j phi_p) g_b(w_p) q(tau_p)``.

It is the model of :mod:`sounder.mpc.two_paths_fit`, for any number of paths within a window of delays. The phases
between the paths are fitted, for paths of different delays determine them. The phase ``psi_b`` of a direction is
integrated out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.fit_parameters import AZIMUTH, DELAY, ELEVATION, LEVEL, PHASE, REGULARISATION, Parameter
from sounder.mpc.pattern_slopes import Cuts, slopes
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
    cost, normal, gradient, residual = _normal_equations(paths, beams, window, cuts)
    for _ in range(MAX_STEPS):
        flat = paths.ravel()
        free = ~(((flat <= lower) & (gradient < 0)) | ((flat >= upper) & (gradient > 0)))
        matrix = normal[np.ix_(free, free)]
        step = np.zeros(flat.size)
        step[free] = np.linalg.solve(matrix + np.diag(damping * np.diag(matrix) + 1e-9), gradient[free])
        trial = np.clip(flat + step, lower, upper).reshape(paths.shape)
        at_trial = _normal_equations(trial, beams, window, cuts)
        decrease = cost - at_trial[0]
        if decrease > 0:
            paths, (cost, normal, gradient, residual) = trial, at_trial
        damping *= 0.2 if decrease > 0 else 6.0
        if 0 < decrease < JOINT_CONVERGENCE or damping > 1e6:
            break
    freedom = max(2 * residual.size - len(residual) - paths.size, 1)
    return JointFit(paths, cost, 2 * normal, float(2 * np.sum(np.abs(residual) ** 2) / freedom), residual)


def _normal_equations(
    paths: Real, beams: BeamSamples, window: WindowPulse, cuts: Cuts
) -> tuple[float, Real, Real, Complex]:
    """Cost, normal equations, gradient and residuals."""
    g, by_azimuth, by_elevation = slopes(paths[:, AZIMUTH], paths[:, ELEVATION], beams.directions, cuts)
    pulse, slope = window.at(paths[:, DELAY])
    factor = (np.exp(paths[:, LEVEL] + 1j * paths[:, PHASE])[:, None] / np.sqrt(beams.noise))[..., None]
    amplitude = factor * pulse[:, None]
    each = g[..., None] * amplitude
    derivatives = np.stack(
        [
            by_azimuth[..., None] * amplitude,
            by_elevation[..., None] * amplitude,
            each,
            g[..., None] * factor * slope[:, None],
            1j * each,
        ],
        axis=1,
    ).reshape(-1, *each.shape[1:])
    model = each.sum(axis=0)
    inner = np.sum(model.conj() * beams.samples, axis=-1)
    size = np.abs(inner)
    u = np.sqrt(4 * size**2 + 2.25)
    bessel_ratio = 2 * size / (0.5 + u)
    energy = np.sum(np.abs(model) ** 2, axis=-1)
    cost = float(np.sum(energy - u + 0.5 * np.log(0.5 + u)))
    rotated = beams.samples * (inner.conj() / np.maximum(size, 1e-300))[:, None]
    # The phase of a direction absorbs its share of what a parameter changes.
    share = np.sum(model.conj() * derivatives, axis=-1).imag / np.maximum(energy, 1e-300)
    derivatives = derivatives - 1j * share[..., None] * model
    flat = _as_real(derivatives)
    weight = np.minimum(np.sqrt(2) * bessel_ratio, 1) ** 2
    weighted = flat * np.tile(np.repeat(weight, model.shape[1]), 2)
    gradient = flat @ _as_real((bessel_ratio[:, None] * rotated - model)[None])[0]
    return cost, weighted @ flat.T, gradient, rotated - model


def _as_real(values: Complex) -> Real:
    """Complex (row, beam, combination) as twice as many real numbers per row."""
    flat = values.reshape(len(values), -1)
    return np.concatenate([flat.real, flat.imag], axis=1)


def best_phases(paths: Real, beams: BeamSamples, window: WindowPulse, cuts: Cuts) -> Real:
    """Phases (path,) that fit best: those of directions and of paths in turn, from those of the strongest path."""
    g, _, _ = slopes(paths[:, AZIMUTH], paths[:, ELEVATION], beams.directions, cuts)
    pulse, _ = window.at(paths[:, DELAY])
    each = (np.exp(paths[:, LEVEL])[:, None] * g / np.sqrt(beams.noise))[..., None] * pulse[:, None]
    flat = each.reshape(len(each), -1)
    gram = flat.conj() @ flat.T
    gram += LOADING * np.diag(np.diag(gram).real + 1e-300)
    model = each[np.argmax(np.diag(gram).real)]
    amplitude = np.ones(len(paths), complex)
    for _ in range(PHASE_ITERATIONS):
        inner = np.sum(model.conj() * beams.samples, axis=-1)
        rotated = beams.samples * (inner.conj() / np.maximum(np.abs(inner), 1e-300))[:, None]
        amplitude = np.linalg.solve(gram, flat.conj() @ rotated.ravel())
        model = np.einsum("p,pbk->bk", amplitude, each)
    return np.asarray(np.angle(amplitude))
