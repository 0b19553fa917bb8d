"""Several paths fitted at once to the samples of many beams, with one phase of each for all directions.

In direction ``b`` the samples, whitened, are ``y_b = exp(j psi_b) s_b + n_b`` with

``s_b = sum_p exp(A_p + j phi_p) g_b(w_p) q(tau_p)``.

It is the model of :mod:`sounder.mpc.two_paths_fit`, of any number of paths within a window of delays, with the phases
between them fitted: paths of unlike delays tell them. ``psi_b`` is a direction's own and integrated out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.cir.matched_filter import OVERSAMPLING, MatchedFilter, whitening_matrix
from sounder.mpc.pattern_slopes import Cuts, slopes
from sounder.mpc.two_paths_fit import AZIMUTH, DELAY, ELEVATION, LEVEL, Beams

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

PHASE = 4
"""Parameter of a path after those of `pair_fit`: phase [radian]. Delays are counted from the window's first sample."""
COLUMNS = 5
COARSE = 2
"""Points of a pulse's table that are one of the window's; linear between, good to -68 dB."""
SETTLED = 0.01
"""Logarithm of the likelihood that no step gains any more: a seventh of a deviation."""
STEPS = 30
"""Most steps of a fit."""
ROUNDS = 6
"""Turns of phases of paths and directions, each given the others."""
TINY = 1e-6
"""Information that makes a matrix regular without telling anything."""
ALIKE = 0.05
"""Energy added to each pulse, relative, so that pulses nearly alike do not cancel with large amplitudes."""


@dataclass(frozen=True)
class Window:
    """Delays that a group of paths is fitted in.

    Attributes
    ----------
    whitener : array complex (combination, sample)
        To unit noise in each combination, for noise of power 1 a sample.
    pulse, slope : array complex (point, combination)
        Whitened pulses of amplitude 1 , ``OVERSAMPLING / COARSE`` a sample, and their derivatives [1/sample].
    """

    whitener: Complex
    pulse: Complex
    slope: Complex

    @classmethod
    def of(cls, matched: MatchedFilter, noise: Real, size: int) -> "Window":
        """Tables for ``size`` samples in noise of a density (sample,), mean 1."""
        lags = np.arange(size)
        white = whitening_matrix(noise, size)
        point = (
            matched.pulse.size // 2
            + OVERSAMPLING * lags
            - COARSE * np.arange((size - 1) * OVERSAMPLING // COARSE + 1)[:, None]
        )
        inside = (point >= 0) & (point < matched.pulse.size)
        pulse = np.where(inside, matched.pulse[np.where(inside, point, 0)], 0) @ white.T
        return cls(white, pulse, np.gradient(pulse, COARSE / OVERSAMPLING, axis=0))

    def at(self, delay: Real) -> tuple[Complex, Complex]:
        """Pulse and slope (path, combination) at delays (path,)."""
        place = np.clip(delay * (OVERSAMPLING // COARSE), 0, len(self.pulse) - 1.001)
        left = place.astype(int)
        right = (place - left)[:, None]
        before, after = self.pulse[left], self.pulse[left + 1]
        return before * (1 - right) + after * right, self.slope[left] * (1 - right) + self.slope[left + 1] * right


@dataclass(frozen=True)
class Fit:
    """What a fit led to.

    Attributes
    ----------
    paths : array (path, 5)
    cost : float
        Negative logarithm of the likelihood.
    information : array (parameter, parameter)
        Of the five parameters of each path in turn; singular by one phase common to all.
    misfit : float
        Residual power over that of the noise.
    left : array complex (beam, combination)
        Residuals, turned to the phases of the paths.
    """

    paths: Real
    cost: float
    information: Real
    misfit: float
    left: Complex

    @property
    def covariance(self) -> Real:
        """Of the parameters, with the residual power as variance where that is more than was allowed for."""
        return np.asarray(
            max(1.0, self.misfit) * np.linalg.inv(self.information + TINY * np.eye(len(self.information)))
        )


def fit(paths: Real, bounds: Real, beams: Beams, window: Window, cuts: Cuts) -> Fit:
    """Levenberg-Marquardt from one start.

    Parameters
    ----------
    paths : array (path, 5)
        Start.
    bounds : array (2, path, 5)
        Least and most of each parameter.
    beams : Beams
        Directions, and their samples in combinations of the window.
    window : Window
    cuts : Cuts
        Of the antenna.
    """
    low, high = bounds.reshape(2, -1)
    paths = np.clip(paths, *bounds)
    damping = 1e-2
    cost, normal, down, left = _equations(paths, beams, window, cuts)
    for _ in range(STEPS):
        flat = paths.ravel()
        free = ~(((flat <= low) & (down < 0)) | ((flat >= high) & (down > 0)))
        steep = normal[np.ix_(free, free)]
        step = np.zeros(flat.size)
        step[free] = np.linalg.solve(steep + np.diag(damping * np.diag(steep) + 1e-9), down[free])
        tried = np.clip(flat + step, low, high).reshape(paths.shape)
        there = _equations(tried, beams, window, cuts)
        gained = cost - there[0]
        if gained > 0:
            paths, (cost, normal, down, left) = tried, there
        damping *= 0.2 if gained > 0 else 6.0
        if 0 < gained < SETTLED or damping > 1e6:
            break
    freedom = max(2 * left.size - len(left) - paths.size, 1)
    return Fit(paths, cost, 2 * normal, float(2 * np.sum(np.abs(left) ** 2) / freedom), left)


def _equations(paths: Real, beams: Beams, window: Window, cuts: Cuts) -> tuple[float, Real, Real, Complex]:
    """Cost, normal equations and residuals."""
    g, by_azimuth, by_elevation = slopes(paths[:, AZIMUTH], paths[:, ELEVATION], beams.looks, cuts)
    pulse, slope = window.at(paths[:, DELAY])
    factor = (np.exp(paths[:, LEVEL] + 1j * paths[:, PHASE])[:, None] / np.sqrt(beams.noise))[..., None]
    along = factor * pulse[:, None]
    each = g[..., None] * along
    columns = np.stack(
        [
            by_azimuth[..., None] * along,
            by_elevation[..., None] * along,
            each,
            g[..., None] * factor * slope[:, None],
            1j * each,
        ],
        axis=1,
    ).reshape(-1, *each.shape[1:])
    model = each.sum(axis=0)
    inner = np.sum(model.conj() * beams.data, axis=-1)
    size = np.abs(inner)
    u = np.sqrt(4 * size**2 + 2.25)
    told = 2 * size / (0.5 + u)
    own = np.sum(np.abs(model) ** 2, axis=-1)
    cost = float(np.sum(own - u + 0.5 * np.log(0.5 + u)))
    turned = beams.data * (inner.conj() / np.maximum(size, 1e-300))[:, None]
    left = told[:, None] * turned - model
    # The phase of a direction takes its part of what the parameters change.
    share = np.sum(model.conj() * columns, axis=-1).imag / np.maximum(own, 1e-300)
    columns = columns - 1j * share[..., None] * model
    flat = _real(columns)
    weight = np.minimum(np.sqrt(2) * told, 1) ** 2
    heavy = flat * np.tile(np.repeat(weight, left.shape[1]), 2)
    return cost, heavy @ flat.T, flat @ _real(left[None])[0], turned - model


def _real(columns: Complex) -> Real:
    """Complex (row, beam, combination) as twice as many real numbers a row."""
    flat = columns.reshape(len(columns), -1)
    return np.concatenate([flat.real, flat.imag], axis=1)


def phases(paths: Real, beams: Beams, window: Window, cuts: Cuts) -> Real:
    """Phases (path,) that fit best, directions' and paths' in turn, from those of the strongest path."""
    g, _, _ = slopes(paths[:, AZIMUTH], paths[:, ELEVATION], beams.looks, cuts)
    pulse, _ = window.at(paths[:, DELAY])
    each = (np.exp(paths[:, LEVEL])[:, None] * g / np.sqrt(beams.noise))[..., None] * pulse[:, None]
    flat = each.reshape(len(each), -1)
    alike = flat.conj() @ flat.T
    alike += ALIKE * np.diag(np.diag(alike).real + 1e-300)
    model = each[np.argmax(np.diag(alike).real)]
    amplitude = np.ones(len(paths), complex)
    for _ in range(ROUNDS):
        turn = np.sum(model.conj() * beams.data, axis=-1)
        turned = beams.data * (turn.conj() / np.maximum(np.abs(turn), 1e-300))[:, None]
        amplitude = np.linalg.solve(alike, flat.conj() @ turned.ravel())
        model = np.einsum("p,pbk->bk", amplitude, each)
    return np.asarray(np.angle(amplitude))
