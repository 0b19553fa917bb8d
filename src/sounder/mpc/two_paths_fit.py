"""One path or two, fitted to the samples of many beams about a delay, with one phase between them.

In direction ``b`` the samples, whitened, are ``y_b = exp(j psi_b) s_b + n_b`` with

``s_b = sum_p exp(A_p + j phi_p) g_b(w_p) q(tau_p)``,  ``phi_1 = 0``.

``q`` is the whitened pulse. The phase ``psi_b`` of a direction is its own, for the horn turns and the cable drifts; the
phase ``phi_2`` between two paths is taken to be the same in all. As nothing is known of ``psi_b``, it is integrated
out: with ``x_b = 2 |s_b^H y_b|`` the logarithm of the likelihood is

``-sum_b |y_b|^2 + |s_b|^2 - log I0(x_b)``.

Its derivative is that of least squares on ``R(x_b) y_b`` turned to the phase of ``s_b``, with ``R = I1 / I0``: a beam
that holds no more than noise has no phase to turn to, and counts the less. Both functions are those of Amos's bound

``R(x) = x / (1/2 + u)``, ``log I0(x) = u - log(1/2 + u) / 2 + const``, ``u = sqrt(x^2 + 9/4)``,

which is exact for weak and for strong.

References
----------
Amos, "Computation of modified Bessel functions and their ratios", Mathematics of Computation 28, 1974.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.cir.matched_filter import OVERSAMPLING, MatchedFilter, whitening_matrix
from sounder.instrument.antenna_pattern import Pattern
from sounder.mpc.pattern_slopes import Cuts, slopes

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

SAMPLES = 6
"""Samples to each side of the delay."""
REACH = 1.0
"""How far from the middle sample a path may be [sample]."""
FAINT = 0.1
"""Share of the most strength under which a combination of samples tells nothing of pulses within reach."""
UNLIKE = np.log(2) / 2
"""How unlike the amplitudes of two paths are expected to be, as the deviation of their logarithms: 3 dB, as
most are whose sum does not look like the stronger alone."""
SETTLED = 1e-3
"""Squared residual, in noise powers, that no step gains any more."""
AZIMUTH, ELEVATION, LEVEL, DELAY = range(4)
"""Parameters of a path: angles [degree], logarithm of the amplitude, delay after the middle sample [sample]."""


@dataclass(frozen=True)
class Samples:
    """What whitens the samples about a delay, and a pulse of amplitude 1 after it.

    Attributes
    ----------
    whitener : array complex (combination, sample)
        To unit noise in each combination, for noise of power 1 a sample.
    pulse, slope : array complex (point, combination)
        Pulses `OVERSAMPLING` points a sample, from ``-REACH`` to ``REACH``, and their derivatives by delay [1/sample].
    """

    whitener: Complex
    pulse: Complex
    slope: Complex

    @classmethod
    def of(cls, matched: MatchedFilter, noise: Real) -> "Samples":
        """Tables for noise of a density (sample,), mean 1."""
        lags = np.arange(2 * SAMPLES + 1)
        white = whitening_matrix(noise, lags.size)
        middle = matched.pulse.size // 2
        points = np.arange(-int(REACH * OVERSAMPLING), int(REACH * OVERSAMPLING) + 1)
        pulses = matched.pulse[middle + OVERSAMPLING * (lags - SAMPLES) - points[:, None]] @ white.T
        _, strength, right = np.linalg.svd(pulses, full_matrices=False)
        seen = right[strength > FAINT * strength[0]]
        pulses = pulses @ seen.conj().T
        return cls(seen.conj() @ white, pulses, np.gradient(pulses, 1 / OVERSAMPLING, axis=0))

    def at(self, delay: Real) -> tuple[Complex, Complex]:
        """Pulse and slope (..., combination) at delays (...)."""
        place = (np.clip(delay, -REACH, REACH) + REACH) * OVERSAMPLING
        left = np.minimum(place.astype(int), len(self.pulse) - 2)
        right = (place - left)[..., None]
        return tuple(table[left] * (1 - right) + table[left + 1] * right for table in (self.pulse, self.slope))


@dataclass(frozen=True)
class Beams:
    """Beams of a group.

    Attributes
    ----------
    looks : array (beam, 2)
        Azimuth and elevation [degree].
    noise : array (beam,)
        Noise power of a sample.
    data : array complex (beam, combination)
        Whitened samples; of noise power 1, whatever the beam's.
    """

    looks: Real
    noise: Real
    data: Complex


@dataclass(frozen=True)
class Sight:
    """What beams see a path with.

    Attributes
    ----------
    samples : Samples
    pattern : Pattern
    widths : (float, float)
        Half-power beamwidths in azimuth and elevation [degree].
    fan : array (2,)
        Lowest and highest elevation that a main lobe sees [degree].
    cuts : Cuts
        The pattern's.
    """

    samples: Samples
    pattern: Pattern
    widths: tuple[float, float]
    fan: Real
    cuts: Cuts

    def bounds(self, middle: float, reach: float) -> Real:
        """Least and most of a path's parameters (2, 4), within beamwidths of an azimuth and in the fan."""
        aside = reach * self.widths[0]
        return np.array([[middle - aside, self.fan[0], -60.0, -REACH], [middle + aside, self.fan[1], 60.0, REACH]])


def linearised(paths: Real, phase: Real, beams: Beams, sight: Sight) -> tuple[Real, Complex, Complex, Complex]:
    """Negative log-likelihood, residuals (..., beam, combination), derivatives (..., parameter, beam, combination).

    The derivatives twice: those that make the gradient, and those that make the information.
    """
    g, by_azimuth, by_elevation = slopes(paths[..., AZIMUTH], paths[..., ELEVATION], beams.looks, sight.cuts)
    pulse, slope = sight.samples.at(paths[..., DELAY])
    turn = np.zeros(paths.shape[:-1])
    if paths.shape[-2] > 1:
        turn[..., 1] = phase
    factor = (np.exp(paths[..., LEVEL] + 1j * turn)[..., None] / np.sqrt(beams.noise))[..., None]
    along = factor * pulse[..., None, :]
    each = g[..., None] * along
    columns = np.stack(
        [
            by_azimuth[..., None] * along,
            by_elevation[..., None] * along,
            each,
            g[..., None] * factor * slope[..., None, :],
        ],
        axis=-3,
    )
    columns = columns.reshape(*paths.shape[:-2], -1, *each.shape[-2:])
    model = each.sum(axis=-3)
    inner = np.sum(model.conj() * beams.data, axis=-1)
    size = np.abs(inner)
    u = np.sqrt(4 * size**2 + 2.25)
    told = 2 * size / (0.5 + u)
    own = np.sum(np.abs(model) ** 2, axis=-1)
    cost = np.sum(own - u + 0.5 * np.log(0.5 + u), axis=-1)
    aligned = beams.data * (told * inner.conj() / np.maximum(size, 1e-300))[..., None]
    turned = 1j * model
    share = np.sum(turned.conj()[..., None, :, :] * columns, axis=-1).real / np.maximum(own, 1e-300)[..., None, :]
    columns = columns - share[..., None] * turned[..., None, :, :]
    weight = np.minimum(np.sqrt(2) * told, 1)[..., None, :, None]
    return cost, aligned - model, columns, columns * weight


def fit(paths: Real, phase: Real, beams: Beams, sight: Sight, bounds: Real, *, steps: int) -> tuple[Real, Real, Real]:
    """Levenberg-Marquardt from several starts at once.

    Parameters
    ----------
    paths : array (start, path, 4)
        One path or two.
    phase : array (start,)
        Of the second, kept [radian].
    beams, sight
    bounds : array (2, 4)
        Least and most of each parameter of a path.
    steps : int
        Most steps.

    Returns
    -------
    paths : array (start, path, 4)
        Where each start led.
    cost : array (start,)
        Negative logarithm of likelihood and expectation.
    information : array (start, parameter, parameter)
        Fisher information, the four parameters of each path in turn.
    """
    paths = np.clip(paths, *bounds)
    damping = np.full(len(paths), 1e-2)
    cost, normal, down = _equations(paths, phase, beams, sight)
    left = np.arange(len(paths))
    for _ in range(steps):
        steep = np.einsum("sii->si", normal[left])
        damped = normal[left] + (damping[left, None] * steep + 1e-9)[:, :, None] * np.eye(steep.shape[1])
        step = np.linalg.solve(damped, down[left, :, None])[..., 0]
        tried = np.clip(paths[left] + step.reshape(-1, *paths.shape[1:]), *bounds)
        cost_there, normal_there, down_there = _equations(tried, phase[left], beams, sight)
        gained = cost[left] - cost_there
        better = gained > 0
        won = left[better]
        paths[won], cost[won] = tried[better], cost_there[better]
        normal[won], down[won] = normal_there[better], down_there[better]
        damping[left] *= np.where(better, 0.2, 8.0)
        if better.any() and gained.max() < SETTLED:
            break
        left = left[~better | (gained >= SETTLED)]
    return paths, cost, 2 * normal


def _unlike(paths: Real) -> Real:
    """Half the square of how unlike two levels are, in the deviations expected."""
    return 0.5 * np.square(paths[:, 0, LEVEL] - paths[:, -1, LEVEL]) / UNLIKE**2


def _expect(paths: Real, normal: Real, down: Real) -> None:
    """Add to normal equations that two levels are expected to be alike."""
    if paths.shape[1] < 2:
        return
    more = 0.5 / UNLIKE**2
    apart = paths[:, 0, LEVEL] - paths[:, 1, LEVEL]
    one, other = LEVEL, 4 + LEVEL
    normal[:, one, one] += more
    normal[:, other, other] += more
    normal[:, one, other] -= more
    normal[:, other, one] -= more
    down[:, one] -= more * apart
    down[:, other] += more * apart


def _equations(paths: Real, phase: Real, beams: Beams, sight: Sight) -> tuple[Real, Real, Real]:
    """Cost and normal equations."""
    cost, left, columns, told = linearised(paths, phase, beams, sight)
    down = (_real(columns) @ _real(left[:, None])[:, 0, :, None])[..., 0]
    flat = _real(told)
    normal = flat @ flat.swapaxes(1, 2)
    _expect(paths, normal, down)
    return cost + _unlike(paths), normal, down


def _real(columns: Complex) -> Real:
    """Complex (..., beam, combination) as twice as many real numbers."""
    flat = columns.reshape(*columns.shape[:-2], -1)
    return np.concatenate([flat.real, flat.imag], axis=-1)
