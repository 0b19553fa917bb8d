"""Where two paths of one delay probably are: mean and covariance over all that beams leave open.

About two paths in neighbouring beams the likelihood has ridges and several maxima, for what the phase between them does
to the magnitudes, directions do as well. The best fit is then not what is least wrong, nor is its curvature the error.
So directions and levels are drawn from the fits at several phases, weighed by how likely they are, and drawn again from
what that makes of them (importance sampling, [1]_).

Whether the phase between the paths is the same in all directions is not known. With a phase ``p`` of ``P`` and
``c_bp`` the negative log-likelihood of a direction, the likelihood is

``(mean_p exp(-sum_b c_bp) + prod_b mean_p exp(-c_bp)) / 2``,

the same phase in all, or one of its own in each.

References
----------
.. [1] Cappe et al., "Population Monte Carlo", Journal of Computational and Graphical Statistics 13, 2004.
"""

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.two_paths_fit import AZIMUTH, DELAY, ELEVATION, LEVEL, UNLIKE, Beams, Sight

Real = NDArray[np.float64]

DRAWN = np.array([AZIMUTH, ELEVATION, LEVEL, 4 + AZIMUTH, 4 + ELEVATION, 4 + LEVEL])
"""Parameters that are drawn; delays hang on none of them."""
DRAWS, ROUNDS = 256, 3
"""Draws in a round."""
FREEDOM = 5.0
"""Of the t distributions that are drawn from: longer tails than a normal one's."""
WIDER = 2.0
"""Deviations of these, over those of the fits."""
LONELY = 0.9
"""Largest sum of squared weights that tells how few draws count."""
LEAST = 0.1
"""Share of the fits' covariance that a round of draws has at least, besides that of the round before."""
PHASES = 6
"""Phases between the paths, in half a circle."""


def posterior(mean: Real, covariance: Real, share: Real, bounds: Real, seen: Beams, sight: Sight) -> tuple[Real, Real]:
    """Mean (2, 4) and covariance (8, 8) of two paths.

    Parameters
    ----------
    mean : array (fit, 2, 4)
    covariance : array (fit, 8, 8)
    share : array (fit,)
        How likely each fit is.
    bounds : array (2, 4)
        Least and most of each parameter of a path.
    seen : Beams
    sight : Sight
    """
    rng = np.random.default_rng(0)
    flat = mean.reshape(-1, 8)
    proposals = [(flat[:, DRAWN], WIDER**2 * covariance[:, DRAWN[:, None], DRAWN], 0.7 * share + 0.3 / share.size)]
    delay = share @ mean[:, :, DELAY]
    within = np.einsum("s,sij->ij", share, covariance[:, DRAWN[:, None], DRAWN])
    drawn, likely = np.zeros((0, 6)), np.zeros(0)
    for _ in range(ROUNDS):
        more = _draw(*proposals[-1], rng)
        drawn = np.concatenate([drawn, more])
        likely = np.concatenate([likely, _likelihood(more.reshape(-1, 2, 3), delay, bounds, seen, sight)])
        density = np.logaddexp.reduce([_density(drawn, *proposal) for proposal in proposals], axis=0)
        weight = np.exp(likely - density - np.max(likely - density))
        weight /= weight.sum()
        middle = weight @ drawn
        # Of few draws that count, the covariance is too small, and the mean is wrong by a share of it.
        alone = min(np.sum(weight**2), LONELY)
        spread = (drawn - middle).T @ ((drawn - middle) * weight[:, None]) * (1 + alone) / (1 - alone)
        proposals.append((middle[None], (spread + LEAST * within)[None], np.ones(1)))
    paths = (share @ flat).reshape(2, 4)
    away = flat - share @ flat
    both = np.einsum("s,sij->ij", share, covariance) + (away * share[:, None]).T @ away
    paths.reshape(-1)[DRAWN] = middle
    both[DRAWN[:, None], DRAWN] = spread
    late = np.array([DELAY, 4 + DELAY])
    both[late[:, None], DRAWN] = both[DRAWN[:, None], late] = 0.0
    return paths, both


def _draw(middle: Real, covariance: Real, share: Real, rng: np.random.Generator) -> Real:
    which = rng.choice(share.size, DRAWS, p=share / share.sum())
    root = np.linalg.cholesky(covariance)[which]
    long = np.sqrt(rng.chisquare(FREEDOM, DRAWS) / FREEDOM)
    drawn: Real = middle[which] + np.einsum("nij,nj->ni", root, rng.standard_normal((DRAWS, 6))) / long[:, None]
    return drawn


def _density(drawn: Real, middle: Real, covariance: Real, share: Real) -> Real:
    """Logarithm of the density of draws, but for a constant."""
    away = drawn[:, None] - middle
    square = np.einsum("nki,kij,nkj->nk", away, np.linalg.inv(covariance), away)
    level = -0.5 * np.linalg.slogdet(covariance)[1] - (FREEDOM + 6) / 2 * np.log1p(square / FREEDOM)
    density: Real = np.logaddexp.reduce(level + np.log(share / share.sum()), axis=1)
    return density


def _likelihood(drawn: Real, delay: Real, bounds: Real, seen: Beams, sight: Sight) -> Real:
    """Logarithm of likelihood and expectation (draw,) of two paths (draw, 2, 3)."""
    pulse, _ = sight.samples.at(delay)
    heard = seen.data @ pulse.conj().T  # (beam, path)
    toward = 10 ** (sight.pattern.beam_gain(drawn[..., :1], drawn[..., 1:2], *seen.looks.T) / 20)
    # In single precision the likelihood's logarithm is good to 1e-3, and takes half the time.
    size = (np.exp(drawn[..., 2:]) * toward / np.sqrt(seen.noise)).astype(np.float32)
    first, second = size[:, 0], size[:, 1]
    phase = np.exp(1j * (np.arange(PHASES) + 0.5) * np.pi / PHASES)
    energy = np.sum(np.abs(pulse) ** 2, axis=1).astype(np.float32)
    together = 2 * (phase * np.vdot(pulse[0], pulse[1])).real.astype(np.float32)
    own = (energy[0] * first**2 + energy[1] * second**2)[..., None] + (first * second)[..., None] * together
    # |s^H y|^2 of two terms, each of a phase
    power = (np.abs(heard) ** 2).astype(np.float32)
    cross = 2 * (phase * (heard[:, 0] * heard[:, 1].conj())[:, None]).real.astype(np.float32)
    inner = (power[:, 0] * first**2 + power[:, 1] * second**2)[..., None] + (first * second)[..., None] * cross
    u = np.sqrt(4 * np.maximum(inner, 0) + 2.25)
    cost = own - u + 0.5 * np.log(0.5 + u)
    shared, each = _mean_of(-cost.sum(axis=1, dtype=float)), _mean_of(-cost).sum(axis=1, dtype=float)
    apart = drawn[:, 0, 2] - drawn[:, 1, 2]
    inside = ((drawn >= bounds[0, :3]) & (drawn <= bounds[1, :3])).all(axis=(1, 2))
    likelihood: Real = np.logaddexp(shared, each) - 0.5 * (apart / UNLIKE) ** 2
    return np.where(inside, likelihood, -np.inf)


def _mean_of(level: NDArray[np.floating]) -> NDArray[np.floating]:
    """Logarithm of the mean, over the last axis, of what these are logarithms of."""
    most = level.max(axis=-1)
    mean: NDArray[np.floating] = most + np.log(np.mean(np.exp(level - most[..., None]), axis=-1))
    return mean
