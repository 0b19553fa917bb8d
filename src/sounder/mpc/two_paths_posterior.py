"""Posterior of two paths of one delay: mean and covariance over all directions that the beams allow.

The likelihood of two paths in neighbouring beams has several maxima and long valleys, because the phase between the
paths changes the magnitudes as their directions do. The best fit is then not the best estimate, and its curvature is
not the error. So directions and levels are drawn from the fits at several phases, weighted by their likelihood, and
drawn again from the mean and covariance of these draws (importance sampling, [1]_).

Whether the phase between the paths is the same in all directions is not known. With a phase ``p`` of ``P`` and
``c_bp`` the negative log-likelihood of a direction, the likelihood is

``(mean_p exp(-sum_b c_bp) + prod_b mean_p exp(-c_bp)) / 2``,

the same phase in all directions, or one of its own in each.

References
----------
.. [1] Cappe et al., "Population Monte Carlo", Journal of Computational and Graphical Statistics 13, 2004.
"""

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.fit_parameters import AZIMUTH, DELAY, ELEVATION, LEVEL
from sounder.mpc.scan import Scan
from sounder.mpc.two_paths_fit import LEVEL_SPREAD, PARAMETERS, PHASES
from sounder.mpc.whitened_samples import BeamSamples

Real = NDArray[np.float64]
LARGEST = float(np.finfo(np.float32).max) ** 0.25
"""Amplitude over noise from which on draws are alike (190 dB): its square times a sum of samples is still a number."""

DRAWN_PARAMETERS = np.array(
    [path * PARAMETERS + parameter for path in range(2) for parameter in (AZIMUTH, ELEVATION, LEVEL)]
)
"""Parameters that are drawn. Delays depend on none of them."""
DELAYS = np.array([DELAY, PARAMETERS + DELAY])
DRAWS_PER_ROUND = 256
"""Draws in a round; chosen, not derived."""
DRAW_ROUNDS = 3
"""Rounds of draws; chosen, not derived."""
DEGREES_OF_FREEDOM = 5.0
"""Degrees of freedom of the t distributions that are drawn from: their tails are longer than a normal one's."""
INITIAL_WIDENING = 2.0
"""Standard deviations of the first distributions, over those of the fits."""
MAX_CONCENTRATION = 0.9
"""Upper limit of the sum of squared weights in the correction for few effective draws."""
FIT_SHARE = 0.1
"""Share of the fits' covariance that is added to that of a round, so that no round collapses."""


def posterior(
    mean: Real, covariance: Real, share: Real, bounds: Real, beams: BeamSamples, scan: Scan
) -> tuple[Real, Real]:
    """Posterior mean (2, 4) and covariance (8, 8) of two paths.

    Parameters
    ----------
    mean : array (fit, 2, 4)
    covariance : array (fit, 8, 8)
    share : array (fit,)
        Probability of each fit.
    bounds : array (2, 4)
        Lower and upper bound of each parameter of a path.
    beams : BeamSamples
    scan : Scan
    """
    rng = np.random.default_rng(0)
    flat = mean.reshape(-1, 2 * PARAMETERS)
    drawn_block = covariance[:, DRAWN_PARAMETERS[:, None], DRAWN_PARAMETERS]
    proposals = [(flat[:, DRAWN_PARAMETERS], INITIAL_WIDENING**2 * drawn_block, 0.7 * share + 0.3 / share.size)]
    delay = share @ mean[:, :, DELAY]
    within = np.einsum("s,sij->ij", share, drawn_block)
    drawn, likelihood = np.zeros((0, DRAWN_PARAMETERS.size)), np.zeros(0)
    middle, spread = share @ flat[:, DRAWN_PARAMETERS], within
    for _ in range(DRAW_ROUNDS):
        new = _draw(*proposals[-1], rng)
        drawn = np.concatenate([drawn, new])
        likelihood = np.concatenate([likelihood, _log_likelihood(new.reshape(-1, 2, 3), delay, bounds, beams, scan)])
        if not np.isfinite(likelihood).any():
            break  # all draws are outside of the bounds: the fits are all that is known
        density = np.logaddexp.reduce([_log_density(drawn, *proposal) for proposal in proposals], axis=0)
        weight = np.exp(likelihood - density - np.max(likelihood - density))
        weight /= weight.sum()
        middle = weight @ drawn
        # With few effective draws the covariance is too small, and the mean is wrong by a share of it.
        concentration = min(np.sum(weight**2), MAX_CONCENTRATION)
        spread = (drawn - middle).T @ ((drawn - middle) * weight[:, None]) * (1 + concentration) / (1 - concentration)
        proposals.append((middle[None], (spread + FIT_SHARE * within)[None], np.ones(1)))
    paths = (share @ flat).reshape(2, PARAMETERS)
    deviation = flat - share @ flat
    total = np.einsum("s,sij->ij", share, covariance) + (deviation * share[:, None]).T @ deviation
    paths.reshape(-1)[DRAWN_PARAMETERS] = middle
    total[DRAWN_PARAMETERS[:, None], DRAWN_PARAMETERS] = spread
    total[DELAYS[:, None], DRAWN_PARAMETERS] = total[DRAWN_PARAMETERS[:, None], DELAYS] = 0.0
    return paths, total


def _draw(middle: Real, covariance: Real, share: Real, rng: np.random.Generator) -> Real:
    """Draws (draw, parameter) from a mixture of t distributions."""
    component = rng.choice(share.size, DRAWS_PER_ROUND, p=share / share.sum())
    root = np.linalg.cholesky(covariance)[component]
    scale = np.sqrt(rng.chisquare(DEGREES_OF_FREEDOM, DRAWS_PER_ROUND) / DEGREES_OF_FREEDOM)
    normal = rng.standard_normal((DRAWS_PER_ROUND, DRAWN_PARAMETERS.size))
    drawn: Real = middle[component] + np.einsum("nij,nj->ni", root, normal) / scale[:, None]
    return drawn


def _log_density(drawn: Real, middle: Real, covariance: Real, share: Real) -> Real:
    """Logarithm of the density (draw,) of such a mixture, up to a constant."""
    deviation = drawn[:, None] - middle
    square = np.einsum("nki,kij,nkj->nk", deviation, np.linalg.inv(covariance), deviation)
    level = -0.5 * np.linalg.slogdet(covariance)[1] - (DEGREES_OF_FREEDOM + DRAWN_PARAMETERS.size) / 2 * np.log1p(
        square / DEGREES_OF_FREEDOM
    )
    density: Real = np.logaddexp.reduce(level + np.log(share / share.sum()), axis=1)
    return density


def _log_likelihood(drawn: Real, delay: Real, bounds: Real, beams: BeamSamples, scan: Scan) -> Real:
    """Logarithm of likelihood and prior (draw,) of two paths (draw, 2, 3)."""
    inside = ((drawn >= bounds[0, :3]) & (drawn <= bounds[1, :3])).all(axis=(1, 2))
    drawn = np.clip(drawn, bounds[0, :3], bounds[1, :3])  # amplitudes of draws outside may be beyond any number
    pulse, _ = scan.centred_pulse.at(delay)
    output = beams.samples @ pulse.conj().T  # (beam, path)
    toward = 10 ** (scan.pattern.beam_gain(drawn[..., :1], drawn[..., 1:2], *beams.directions.T) / 20)
    # In single precision the logarithm is good to 1e-3, and takes half the time.
    size = np.minimum(np.exp(drawn[..., 2:]) * toward / np.sqrt(beams.noise), LARGEST).astype(np.float32)
    first, second = size[:, 0], size[:, 1]
    phase = np.exp(1j * PHASES)
    energy = np.sum(np.abs(pulse) ** 2, axis=1).astype(np.float32)
    overlap = 2 * (phase * np.vdot(pulse[0], pulse[1])).real.astype(np.float32)
    own = (energy[0] * first**2 + energy[1] * second**2)[..., None] + (first * second)[..., None] * overlap
    # |s^H y|^2 of two terms, each with a phase
    power = (np.abs(output) ** 2).astype(np.float32)
    cross = 2 * (phase * (output[:, 0] * output[:, 1].conj())[:, None]).real.astype(np.float32)
    inner = (power[:, 0] * first**2 + power[:, 1] * second**2)[..., None] + (first * second)[..., None] * cross
    u = np.sqrt(4 * np.maximum(inner, 0) + 2.25)
    cost = own - u + 0.5 * np.log(0.5 + u)
    same_phase, own_phases = _log_mean(-cost.sum(axis=1, dtype=float)), _log_mean(-cost).sum(axis=1, dtype=float)
    difference = drawn[:, 0, 2] - drawn[:, 1, 2]
    likelihood: Real = np.logaddexp(same_phase, own_phases) - 0.5 * (difference / LEVEL_SPREAD) ** 2
    return np.where(inside, likelihood, -np.inf)


def _log_mean(level: NDArray[np.floating]) -> NDArray[np.floating]:
    """Logarithm of the mean, over the last axis, of the exponentials of ``level``."""
    top = level.max(axis=-1)
    mean: NDArray[np.floating] = top + np.log(np.mean(np.exp(level - top[..., None]), axis=-1))
    return mean
