"""Several paths in the samples of many beams, with one phase of each for all directions: the model of their fits.

In direction ``b`` the samples, whitened, are ``y_b = exp(j psi_b) s_b + n_b`` with

``s_b = sum_p exp(A_p + j phi_p) g_b(w_p) q(tau_p)``.

``q`` is the whitened pulse. Every direction has an unknown phase ``psi_b``, for the horn turns and the cable drifts.
The phases ``phi_p`` of the paths are assumed to be the same in all directions. ``psi_b`` is integrated out: with
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

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sounder.kernels.extraction.normal_equations import BeamView, add_normal_equations
from sounder.mpc.fit_parameters import AZIMUTH, DELAY, ELEVATION, LEVEL, PHASE, Parameter
from sounder.mpc.pattern_slopes import Cuts, slopes
from sounder.mpc.whitened_samples import BeamSamples, CentredPulse, WindowPulse

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Pulse = CentredPulse | WindowPulse


class NormalEquations(NamedTuple):
    """Fit of sets of paths, linearised.

    Attributes
    ----------
    cost : array (set,)
        Negative log-likelihood, up to a constant of the samples.
    normal : array (set, parameter, parameter)
        Half of the Fisher information, of the parameters of each path in turn; what the phases of the directions
        absorb is taken out.
    gradient : array (set, parameter)
        Minus half of the derivative of ``cost``.
    """

    cost: Real
    normal: Real
    gradient: Real


def normal_equations(paths: Real, beams: BeamSamples, pulse: Pulse, cuts: Cuts) -> NormalEquations:
    """Linearise the fit of sets of paths.

    Parameters
    ----------
    paths : array (set, path, 5)
        In the order of `sounder.mpc.fit_parameters.Parameter`.
    beams : BeamSamples
        Whitened by ``pulse``.
    pulse : CentredPulse or WindowPulse
    cuts : Cuts
        Of the antenna.
    """
    sets, size = len(paths), paths.shape[1] * len(Parameter)
    result = NormalEquations(np.zeros(sets), np.zeros((sets, size, size)), np.zeros((sets, size)))
    view = BeamView(beams.table, cuts.azimuth, cuts.elevation, float(cuts.floor))
    add_normal_equations(
        np.ascontiguousarray(paths), view, *pulse.at(paths[..., DELAY]), beams.samples, beams.noise, *result
    )
    return result


def responses(paths: Real, beams: BeamSamples, pulse: Pulse, cuts: Cuts) -> Complex:
    """Model of each path (path, 5) in each beam: (path, beam, combination)."""
    g, _, _ = slopes(paths[:, AZIMUTH], paths[:, ELEVATION], beams.directions, cuts)
    amplitude = np.exp(paths[:, LEVEL] + 1j * paths[:, PHASE])[:, None] * g / np.sqrt(beams.noise)
    each: Complex = amplitude[..., None] * pulse.at(paths[:, DELAY])[0][:, None]
    return each


def aligned(model: Complex, beams: BeamSamples) -> tuple[Complex, Real]:
    """Samples (beam, combination) rotated to the phases of a model, and how well these are known, ``R`` (beam,)."""
    seen = np.sum(model.conj() * beams.samples, axis=-1)
    size = np.abs(seen)
    known: Real = 2 * size / (0.5 + np.sqrt(4 * size**2 + 2.25))
    return beams.samples * (seen.conj() / np.maximum(size, 1e-300))[:, None], known
