"""Pairs of surface elements: the radii and the cylinders that they give, and which of these are considered."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.curved.elements import Elements
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.paths import IntArray

PRIOR_DENSITY = 1e-3
"""Prior density of cylinders [1/m2]: one in a square of 30 m, as of poles. Chosen; not derived."""
RADII = (0.05, 300.0)
"""Radii that are considered [m], equally likely per octave: from a lamp post to a facade that bends by a degree in 5 m.
Chosen; not derived."""
THINNEST = float(np.nextafter(RADII[0], RADII[1]))
"""Radius of a pole that comes out thinner [m]."""


def pair_radii(first: Elements, second: Elements) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Radii (pair,) of the cylinders through pairs of elements, their variances, and chi-squared with one freedom.

    Two elements are four equations ``c + a n = p`` for three unknowns: ``dp = a dn`` is left if the centre is
    eliminated. Its weights are those of ``a = dp.dn / |dn|**2``.
    """
    dp, dn = first.point - second.point, first.normal - second.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        start = np.sum(dp * dn, axis=-1) / np.sum(dn * dn, axis=-1)
        start = np.where(is_possible(start), start, 1.0)
        spread = [a + b for a, b in zip(first.centre_covariance(start), second.centre_covariance(start), strict=True)]
        weight = 1 / _quadratic(spread, dn, dn)
        radius = weight * _quadratic(spread, dp, dn)
    return radius, weight, _quadratic(spread, dp, dp) - radius**2 / weight


def radius_densities(seeds: Elements, partners: Elements) -> tuple[FloatArray, FloatArray]:
    """Radii (seed, partner) that partners give with a seed, and the relative density of these radii at each of them.

    Partners on the same cylinder give the same radius within their errors. It is 0 where a pair gives none.
    """
    radius, variance, chi2 = pair_radii(seeds, partners)
    usable = (seeds.link != partners.link) & (chi2 < CHI_SQUARED_GATE) & is_possible(radius) & (variance < radius**2)
    radius, variance = np.where(usable, radius, np.inf), np.where(usable, variance, 1.0)
    density = np.zeros(radius.shape)
    order = np.argsort(~usable, axis=1, kind="stable")[:, : int(usable.sum(axis=1).max(initial=0))]
    own, width = (np.take_along_axis(column, order, axis=1) for column in (radius, variance))
    both = width[:, :, None] + width[:, None, :]
    with np.errstate(invalid="ignore"):
        near = np.exp(-((own[:, :, None] - own[:, None, :]) ** 2) / (2 * both)) / np.sqrt(both)
        together = np.abs(own) * np.nansum(near, axis=-1)
    np.put_along_axis(density, order, np.where(np.isfinite(own), together, 0.0), axis=1)
    return radius, density


def cylinders_of_elements(own: Elements, of: IntArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted least squares of ``c + a n = p``: cylinders (cylinder, 3) and covariances (cylinder, 3, 3).

    Parameters
    ----------
    own : Elements
    of : array (path,) of int
        Number of the cylinder of each, ascending.
    radius : array (cylinder,)
        Of which the weights are.
    """
    a, b, d = own.centre_covariance(radius[of])
    weight = np.stack([d, -b, -b, a], axis=-1).reshape(-1, 2, 2) / (a * d - b * b)[:, None, None]
    design = np.concatenate([np.broadcast_to(np.eye(2), weight.shape), own.normal[:, :, None]], axis=-1)
    weighted = design.swapaxes(-1, -2) @ weight
    starts = np.searchsorted(of, np.arange(len(radius)))
    covariance = np.linalg.pinv(np.add.reduceat(weighted @ design, starts), hermitian=True)
    moment = np.add.reduceat(weighted @ own.point[:, :, None], starts)
    return (covariance @ moment)[:, :, 0], covariance


def is_possible(radius: FloatArray | float) -> Any:
    """Whether radii (...) are considered."""
    return (np.abs(radius) > RADII[0]) & (np.abs(radius) < RADII[1])


def log_prior(radius: Any) -> Any:
    """Log prior density (...) of cylinders of radii (...) [1/m3]."""
    return np.log(PRIOR_DENSITY / (2 * np.abs(radius) * np.log(RADII[1] / RADII[0])))


def best_of_each(score: FloatArray, *keys: np.ndarray) -> IntArray:
    """Index (n,) of the highest score (n,) among those with the same keys, ordered by the last key."""
    order = np.lexsort((-score, *keys))
    return order[np.r_[True, np.any([np.diff(key[order].astype(float)) != 0 for key in keys], axis=0)]]


def _quadratic(spread: Sequence[FloatArray], one: FloatArray, other: FloatArray) -> FloatArray:
    """``one' V**-1 other`` (...) of vectors (..., 2) and covariances (east, both, north)."""
    a, b, d = spread
    (u, v), (x, y) = np.moveaxis(one, -1, 0), np.moveaxis(other, -1, 0)
    return np.asarray((u * x * d - (u * y + v * x) * b + v * y * a) / (a * d - b * b))
