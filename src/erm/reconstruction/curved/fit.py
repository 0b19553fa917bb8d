"""Cylinders fitted to paths: centre and signed radius by least squares, exact by Fermat's principle."""

from typing import NamedTuple

import numpy as np

from erm.geometry.cylinders import Bounce, bounce, spreading_factor
from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.fit import HUBER_THRESHOLD
from erm.reconstruction.model.paths import Paths

MAX_STEPS = 20
"""Gauss-Newton steps at most; five are usual. Chosen; not derived."""
STEP_TOLERANCE = 1e-3
"""Step in standard errors below which a fit has converged."""


class CylinderFit(NamedTuple):
    """A vertical cylinder and how paths agree with it."""

    centre: FloatArray  # (2,) m
    radius: float  # m, negative where concave toward the antennas
    covariance: FloatArray  # (3, 3) m2, of east, north and radius
    chi_squared: FloatArray  # (path,), the cylinder taken as exact; infinite where it reflects nothing
    normal: FloatArray  # (path,) degree, azimuth at the reflection points
    point: FloatArray  # (path, 3) m, reflection points
    excess_loss: FloatArray  # (path,) dB, by divergence


def fit_cylinder(paths: Paths, normal: FloatArray, centre: FloatArray, radius: float) -> CylinderFit | None:
    """Most likely cylinder of paths near a start; None where they do not determine one.

    Parameters
    ----------
    paths : Paths
    normal : array (path,)
        Azimuths of the measured normals [degree], from which the reflection points are searched.
    centre : array (2,)
        [m].
    radius : float
        [m].
    """
    parameters = np.array([*centre, radius])
    covariance: FloatArray = np.eye(3)
    near = normal
    for _ in range(MAX_STEPS):
        found, residual = _compare(paths, near, parameters)
        usable = np.isfinite(residual[:, 0])
        near = np.where(usable, found.normal, normal)
        if np.count_nonzero(usable) < 2:
            return None
        slopes = np.stack([found.length_slopes, found.azimuth_slopes], axis=1) / _std(paths)[:, :, None]
        weight = np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(residual), HUBER_THRESHOLD))
        slopes, residual, weight = slopes[usable].reshape(-1, 3), residual[usable].ravel(), weight[usable].ravel()
        normal_matrix = (slopes * weight[:, None]).T @ slopes
        try:
            covariance = np.asarray(np.linalg.inv(normal_matrix), dtype=float)
        except np.linalg.LinAlgError:
            return None
        step = covariance @ (slopes.T @ (weight * residual))
        # a radius does not change its sign through 0, nor by more than half at once
        share = min(1.0, abs(parameters[2]) / 2 / max(abs(step[2]), 1e-12))
        parameters = parameters + share * step
        if share == 1 and step @ normal_matrix @ step < STEP_TOLERANCE**2:
            break
    if not np.isfinite(parameters).all() or np.linalg.det(covariance) <= 0:
        return None
    return compared(paths, normal, parameters[:2], float(parameters[2]), covariance)


def compared(
    paths: Paths, normal: FloatArray, centre: FloatArray, radius: float, covariance: FloatArray
) -> CylinderFit:
    """Paths against a cylinder."""
    found, residual = _compare(paths, normal, np.array([*centre, radius]))
    chi2 = np.where(np.isfinite(residual[:, 0]), np.sum(residual**2, axis=-1), np.inf)
    s1 = np.linalg.norm(found.point - paths.tx[:, :2], axis=-1)
    height = paths.tx[:, 2] + (paths.rx[:, 2] - paths.tx[:, 2]) * s1 / found.length
    cos_elevation = found.length / np.hypot(found.length, paths.tx[:, 2] - paths.rx[:, 2])
    with np.errstate(invalid="ignore"):
        factor = spreading_factor(
            s1 / cos_elevation,
            (found.length - s1) / cos_elevation,
            radius,
            found.cosine * cos_elevation,
            cos_elevation,
        )
    return CylinderFit(
        centre, radius, covariance, chi2, found.normal, np.column_stack([found.point, height]), -10 * np.log10(factor)
    )


def _compare(paths: Paths, normal: FloatArray, parameters: FloatArray) -> tuple[Bounce, FloatArray]:
    """Reflections off a cylinder, and measured minus predicted length and azimuth (path, 2) in standard errors."""
    found = bounce(paths.tx, paths.rx, parameters[:2], np.full(len(paths), parameters[2]), normal)
    slant = np.hypot(found.length, paths.tx[:, 2] - paths.rx[:, 2])
    residual = np.stack([paths.length - slant, angle_difference(paths.azimuth, found.azimuth)], axis=-1)
    flat = (found.length / slant)[:, None]
    return found._replace(length_slopes=found.length_slopes * flat), residual / _std(paths)


def _std(paths: Paths) -> FloatArray:
    return np.stack([paths.length_std, paths.azimuth_std], axis=-1)
