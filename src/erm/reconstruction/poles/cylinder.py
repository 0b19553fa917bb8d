"""A pole's axis and radius, fitted to the delays, azimuths and losses of its paths together.

Paths are reflected at the surface, on the side of their antennas. The reflection points of antennas around a column
therefore differ by up to its diameter. The loss of a path depends on the radius: the thinner a convex surface, the more
the wave spreads behind it. Delays from several sides determine the radius as well.
"""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.loss import weighted_quantile
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.poles.point_scatterers import (
    MAX_RADIUS,
    MAX_REFINEMENTS,
    MIN_RADIUS,
    POLE_LOSS_SCATTER,
    radii_from_loss,
)
from erm.reconstruction.search.refine_groups import best_of_each_link

ROUNDNESS = 0.01
"""Deviation of masts from cylinders [m]: they taper, and have doors and edges. Chosen; not derived."""
RADIUS_ERROR = 0.1
"""Error of a radius from losses [m], for poles do not reflect perfectly: one of concrete seems four fifths thinner."""
MAX_STEPS = 20
"""Gauss-Newton steps of a fit at most. Chosen; not derived."""
MAX_STEP = 1.0
"""Longest step of a fit [m]; longer ones leave the range of the slopes. Chosen; not derived."""
STEP_TOLERANCE = 1e-6
"""Step below which a fit has converged [m]; far below `ROUNDNESS`. Chosen; not derived."""


class Cylinder(NamedTuple):
    """A vertical cylinder fitted to paths."""

    centre: FloatArray  # (2,) m
    radius: float  # m
    covariance: FloatArray  # (3, 3) m2, of east, north and radius
    chi_squared: FloatArray  # (inlier,) of the paths, the cylinder taken as exact
    radius_by_loss: float  # m; radius of a perfectly reflecting one that loses as much
    radius_by_loss_std: float  # m
    radii: FloatArray  # (inlier,) m, the same of each path
    top: float  # m, of the highest reflection point

    @property
    def radius_chi_squared(self) -> float:
        """Chi-squared of the radius against that of the losses."""
        return ((self.radius - self.radius_by_loss) / self.radius_by_loss_std) ** 2

    @property
    def reduced_chi_squared(self) -> float:
        """Chi-squared per degree of freedom."""
        return (float(self.chi_squared.sum()) + self.radius_chi_squared) / (2 * len(self.chi_squared) - 2)


class CylinderResiduals(NamedTuple):
    """Measured minus predicted values of paths off a cylinder."""

    length: FloatArray  # (path,) m
    azimuth: FloatArray  # (path,) degree
    length_slope: FloatArray  # (path, 3) of the predicted length by east, north and radius
    azimuth_slope: FloatArray  # (path, 3) degree per metre
    reflection_point: FloatArray  # (path, 2) m


def cylinder_residuals(paths: Paths, centre: FloatArray, radius: float) -> CylinderResiduals:
    """Compare paths with those off a cylinder.

    The reflection point lies a radius from the axis, on the bisector of the directions to the antennas, up to terms of
    ``radius**2`` over their distance. A path by way of a surface is the shortest one, so its length changes with the
    axis as if the reflection point moved along: by ``-(u_tx + u_rx)`` per metre, and by ``-2 cos(theta)`` per metre of
    radius.
    """
    tx, rx = paths.tx[:, :2], paths.rx[:, :2]
    outward = _unit(_unit(tx - centre) + _unit(rx - centre))
    point = centre + radius * outward
    to_tx, to_rx = tx - point, rx - point
    horizontal = np.linalg.norm(to_tx, axis=-1) + np.linalg.norm(to_rx, axis=-1)
    slant = np.hypot(horizontal, paths.tx[:, 2] - paths.rx[:, 2])
    by_length = -(_unit(to_tx) + _unit(to_rx)) * (horizontal / slant)[:, None]
    by_azimuth = np.rad2deg(np.stack([to_rx[:, 1], -to_rx[:, 0]], axis=-1) / np.sum(to_rx**2, axis=-1)[:, None])
    azimuth = np.rad2deg(np.arctan2(-to_rx[:, 1], -to_rx[:, 0]))
    return CylinderResiduals(
        paths.length - slant,
        angle_difference(paths.azimuth, azimuth),
        np.column_stack([by_length, np.sum(by_length * outward, axis=-1)]),
        np.column_stack([by_azimuth, np.sum(by_azimuth * outward, axis=-1)]),
        point,
    )


def fit_cylinder(paths: Paths, centre: FloatArray, radius: float) -> Cylinder:
    """Weighted least squares of axis and radius; the radius from the losses is one more measurement.

    The radius of a thin pole may come out negative within its error. Constrained to 0 it would bias the axis.
    """
    for _ in range(MAX_STEPS):
        now = cylinder_residuals(paths, centre, radius)
        by_loss, std = _radius_by_loss(paths, radii_from_loss(paths, now.reflection_point)[0])
        slopes = np.vstack([now.length_slope, now.azimuth_slope, [0.0, 0.0, 1.0]])
        weight = np.r_[1 / _variances(paths).ravel(), std**-2]
        covariance = np.linalg.inv((slopes * weight[:, None]).T @ slopes)
        step = covariance @ (slopes.T @ (weight * np.r_[now.length, now.azimuth, by_loss - radius]))
        step *= min(1.0, MAX_STEP / max(float(np.abs(step).max()), STEP_TOLERANCE))
        centre, radius = centre + step[:2], radius + float(step[2])
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    now = cylinder_residuals(paths, centre, radius)
    radii, height = radii_from_loss(paths, now.reflection_point)
    chi_squared = np.sum(np.stack([now.length, now.azimuth]) ** 2 / _variances(paths), axis=0)
    return Cylinder(centre, radius, covariance, chi_squared, by_loss, std, radii, float(height.max()))


def refine_cylinder(
    paths: Paths, around: IntArray, inliers: IntArray, centre: FloatArray, radius: float, min_support: int
) -> tuple[Cylinder, IntArray] | None:
    """Let a cylinder collect the paths around that agree with it, and fit it to these, until they no longer change.

    Parameters
    ----------
    paths : Paths
    around : array (path,) of int
        Rows of the paths that may be collected.
    inliers : array (inlier,) of int
        Those that it starts from.
    centre : array (2,)
        [m].
    radius : float
        [m].
    min_support : int

    Returns
    -------
    cylinder : Cylinder
    inliers : array (inlier,) of int
        Ascending, one per link. None is returned where fewer than ``min_support`` agree.
    """
    near = paths.take(around)
    for _ in range(MAX_REFINEMENTS):
        cylinder = fit_cylinder(paths.take(inliers), centre, radius)
        centre, radius = cylinder.centre, cylinder.radius
        chi2 = _misfit(near, cylinder)
        inside = np.flatnonzero(chi2 < CHI_SQUARED_GATE)
        best = best_of_each_link(np.zeros_like(inside), near.link[inside], inside, chi2[inside])
        collected = np.sort(around[inside[best]])
        if len(collected) < min_support:
            return None
        if np.array_equal(collected, inliers):
            break
        inliers = collected
    return fit_cylinder(paths.take(inliers), centre, radius), inliers


def _radius_by_loss(paths: Paths, radii: FloatArray) -> tuple[float, float]:
    """Radius that the losses of a pole's paths imply, and its standard error [m].

    The errors of gains beyond the elevations of the scan are correlated, so they are not averaged.
    """
    weight = 1 / (paths.loss_std**2 + POLE_LOSS_SCATTER**2)
    correlated = float(np.sum(weight * paths.loss_std) / np.sum(weight))
    error = np.hypot(correlated, POLE_LOSS_SCATTER / np.sqrt(len(radii)))  # dB
    median = 10 ** (weighted_quantile(10 * np.log10(radii), weight, 0.5) / 10)
    radius = float(np.clip(median, MIN_RADIUS, MAX_RADIUS))
    return radius, float(np.hypot(radius * (10 ** (error / 10) - 1), RADIUS_ERROR))


def _misfit(paths: Paths, cylinder: Cylinder) -> FloatArray:
    """Chi-squared (path,) of paths against a cylinder, its uncertainty included."""
    now = cylinder_residuals(paths, cylinder.centre, cylinder.radius)
    slopes = np.stack([now.length_slope, now.azimuth_slope], axis=1)
    own = slopes @ cylinder.covariance @ slopes.swapaxes(1, 2)
    a, d = own[:, [0, 1], [0, 1]].T + _variances(paths)
    b = own[:, 0, 1]
    return (now.length**2 * d - 2 * now.length * now.azimuth * b + now.azimuth**2 * a) / (a * d - b * b)


def _variances(paths: Paths) -> FloatArray:
    """Variances (2, path) of lengths [m2] and azimuths [degree2] off a pole."""
    return np.stack([paths.length_std**2 + ROUNDNESS**2, paths.azimuth_std**2])


def _unit(vector: FloatArray) -> FloatArray:
    """Vectors (..., 2) of length 1; 0 where there is no direction."""
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-9)
