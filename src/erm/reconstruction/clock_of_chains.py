r"""The common error of the clock, where only reflections off several walls show it.

In a street without direct paths, a clock that is late moves every image away from the receivers, and its walls with it:
lengths and azimuths of single reflections hardly tell. The image in two walls moves by twice as much as either wall
but its paths are late only once. Walls that are as uncertain as the clock predict no chains, but those at one value of
the clock do. With the images ``k`` that chains explain at the clock ``b``, of residual ``r`` and covariance ``C``,

.. math:: \ln p(b) = -\frac{(b - b_0)^2}{2 \sigma^2} + \sum_k \ln\Big(1 + \frac{V}{2 \pi J \sqrt{|C_k|}}
    e^{-r_k^T C_k^{-1} r_k / 2}\Big),

``V`` the range of azimuths times that of lengths and ``J`` the number of chains. All paths of one image are one
observation: they agree with each other whatever the clock is.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.decision.chains import Chains, predict_chains, spread_of_chains
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import IntArray
from erm.survey.bundle import Bundle


class ChainsAt(NamedTuple):
    """Chains that are found with the faces and common errors of an adjustment."""

    chains: Sequence[Chains]
    lines: Lines
    covariance: FloatArray  # (wall, 2, wall, 2)


def with_clock_of_chains(
    found: Bundle, single: float, at: Callable[[Bundle], ChainsAt], image: IntArray, lengths: float
) -> tuple[Bundle, float]:
    """An adjustment with the common clock at which chains off its walls explain most, and the error of this clock.

    The second result is the log-likelihood ratio of these chains to paths from anywhere, over all clocks.

    Parameters
    ----------
    found : Bundle
        Of single reflections.
    single : float
        Standard error of a single length [m].
    at : callable
        Chains that are found with an adjustment.
    image : array (mpc,) of int
        Image of each MPC.
    lengths : float
        Range of lengths [m].
    """
    clock, std = float(found.common[1]), found.clock_std
    # a clock that is off by a single error loses half a unit of log-likelihood
    step = 2 * single
    steps = int(np.ceil(SIGMAS * std / step))
    tried = clock + step * np.arange(-steps, steps + 1)
    log_prior = -(((tried - clock) / std) ** 2) / 2
    log_posterior = log_prior + [
        _evidence(at(found.at_clock(value, 0.0)), image, 360.0 * lengths) for value in tried.tolist()
    ]
    weight = np.exp(log_posterior - log_posterior.max())
    told = log_posterior.max() + np.log(weight.sum() / np.exp(log_prior).sum())
    mean = float(np.average(tried, weights=weight))
    return found.at_clock(mean, float(np.sqrt(np.average((tried - mean) ** 2, weights=weight)))), float(told)


def _evidence(found: ChainsAt, image: IntArray, extent: float) -> float:
    """Log-likelihood ratio of all images that chains explain to images from anywhere."""
    walls = len(found.lines.normal)
    prior = np.log(extent / (2 * np.pi * 2 * walls * max(walls - 1, 1)))  # chains of two, and those that return
    result = 0.0
    for one in found.chains:
        paths = one.paths
        predicted = predict_chains(paths.tx, paths.rx, one.walls, found.lines)
        spread = spread_of_chains(predicted, one.walls, found.covariance)
        apart = np.column_stack([paths.length - predicted.length, angle_difference(paths.azimuth, predicted.azimuth)])
        weight = 1 / np.column_stack([paths.length_std, paths.azimuth_std]) ** 2
        _, of = np.unique(np.column_stack([image[paths.row], one.walls]), axis=0, return_inverse=True)
        for k in range(of.max() + 1):
            rows = of.ravel() == k
            total = weight[rows].sum(axis=0)
            mean = (weight[rows] * apart[rows]).sum(axis=0) / total
            covariance = np.diag(1 / total) + spread[rows].mean(axis=0)
            chi_squared = mean @ np.linalg.solve(covariance, mean)
            result += np.logaddexp(0.0, prior - np.linalg.slogdet(covariance)[1] / 2 - chi_squared / 2)
    return result
