"""Fit of one path or two to the samples of many beams about a delay, with one phase between the paths.

In direction ``b`` the samples, whitened, are ``y_b = exp(j psi_b) s_b + n_b`` with

``s_b = sum_p exp(A_p + j phi_p) g_b(w_p) q(tau_p)``,  ``phi_1 = 0``.

``q`` is the whitened pulse. Every direction has an unknown phase ``psi_b``, for the horn turns and the cable drifts.
The phase ``phi_2`` between two paths is assumed to be the same in all directions. ``psi_b`` is integrated out: with
``x_b = 2 |s_b^H y_b|`` the logarithm of the likelihood is

``-sum_b |y_b|^2 + |s_b|^2 - log I0(x_b)``.

Its derivative is that of least squares on ``R(x_b) y_b`` rotated to the phase of ``s_b``, with ``R = I1 / I0``. A beam
that holds only noise has no known phase and counts less. Both functions are approximated by Amos's bound

``R(x) = x / (1/2 + u)``, ``log I0(x) = u - log(1/2 + u) / 2 + const``, ``u = sqrt(x^2 + 9/4)``,

which is exact in the limits of weak and of strong paths.

References
----------
Amos, "Computation of modified Bessel functions and their ratios", Mathematics of Computation 28, 1974.
"""

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.fit_parameters import AZIMUTH, DELAY, ELEVATION, LEVEL, Parameter
from sounder.mpc.pattern_slopes import slopes
from sounder.mpc.scan import Scan
from sounder.mpc.whitened_samples import BeamSamples

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

PARAMETERS = len(Parameter) - 1
"""Parameters of a path: all but the phase."""
PHASES = (np.arange(6) + 0.5) * np.pi / 6
"""Phases between two paths for which fits are made and likelihoods averaged: half a circle in six steps."""
LEVEL_SPREAD = np.log(2) / 2
"""Expected difference of the levels of two paths, as a standard deviation: 3 dB, as in most pairs whose sum does not
look like the stronger path alone."""
PAIR_CONVERGENCE = 1e-3
"""Decrease of the negative log-likelihood at which a fit ends; chosen, not derived."""


def linearise(paths: Real, phase: Real, beams: BeamSamples, scan: Scan) -> tuple[Real, Complex, Complex, Complex]:
    """Model and derivatives of paths.

    Parameters
    ----------
    paths : array (..., path, 4)
        One path or two, in the order of `sounder.mpc.fit_parameters.Parameter`.
    phase : array (...)
        Of the second path after the first [radian].
    beams : BeamSamples
    scan : Scan

    Returns
    -------
    cost : array (...)
        Negative log-likelihood.
    residual : array complex (..., beam, combination)
    gradient, information : array complex (..., parameter, beam, combination)
        Derivatives of the model: those for the gradient, and those for the information.
    """
    g, by_azimuth, by_elevation = slopes(paths[..., AZIMUTH], paths[..., ELEVATION], beams.directions, scan.cuts)
    pulse, slope = scan.centred_pulse.at(paths[..., DELAY])
    phases = np.zeros(paths.shape[:-1])
    if paths.shape[-2] > 1:
        phases[..., 1] = phase
    factor = (np.exp(paths[..., LEVEL] + 1j * phases)[..., None] / np.sqrt(beams.noise))[..., None]
    amplitude = factor * pulse[..., None, :]
    each = g[..., None] * amplitude
    derivatives = np.stack(
        [
            by_azimuth[..., None] * amplitude,
            by_elevation[..., None] * amplitude,
            each,
            g[..., None] * factor * slope[..., None, :],
        ],
        axis=-3,
    )
    derivatives = derivatives.reshape(*paths.shape[:-2], -1, *each.shape[-2:])
    model = each.sum(axis=-3)
    inner = np.sum(model.conj() * beams.samples, axis=-1)
    size = np.abs(inner)
    u = np.sqrt(4 * size**2 + 2.25)
    bessel_ratio = 2 * size / (0.5 + u)
    energy = np.sum(np.abs(model) ** 2, axis=-1)
    cost = np.sum(energy - u + 0.5 * np.log(0.5 + u), axis=-1)
    aligned = beams.samples * (bessel_ratio * inner.conj() / np.maximum(size, 1e-300))[..., None]
    # The phase of a direction absorbs its share of what a parameter changes.
    by_phase = 1j * model
    share = np.sum(by_phase.conj()[..., None, :, :] * derivatives, axis=-1).real
    share /= np.maximum(energy, 1e-300)[..., None, :]
    derivatives = derivatives - share[..., None] * by_phase[..., None, :, :]
    weight = np.minimum(np.sqrt(2) * bessel_ratio, 1)[..., None, :, None]
    return cost, aligned - model, derivatives, derivatives * weight


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


def _normal_equations(paths: Real, phase: Real, beams: BeamSamples, scan: Scan) -> tuple[Real, Real, Real]:
    """Cost, normal equations and gradient, the prior of the levels included."""
    cost, residual, derivatives, weighted = linearise(paths, phase, beams, scan)
    gradient = (_as_real(derivatives) @ _as_real(residual[:, None])[:, 0, :, None])[..., 0]
    flat = _as_real(weighted)
    normal = flat @ flat.swapaxes(1, 2)
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


def _as_real(values: Complex) -> Real:
    """Complex (..., beam, combination) as twice as many real numbers."""
    flat = values.reshape(*values.shape[:-2], -1)
    return np.concatenate([flat.real, flat.imag], axis=-1)
