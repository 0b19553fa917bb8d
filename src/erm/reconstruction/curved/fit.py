"""Cylinders fitted to paths: centre and signed radius by least squares, exact by Fermat's principle."""

from typing import NamedTuple

import numpy as np

from erm.geometry.cylinders import Bounce, bounce, spreading_factor
from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.fit import HUBER_THRESHOLD
from erm.reconstruction.model.paths import IntArray, Paths

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


def fit_cylinders(paths: Paths, normal: FloatArray, of: IntArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Most likely cylinders of sets of paths near starts.

    Parameters
    ----------
    paths : Paths
    normal : array (path,)
        Azimuths of the measured normals [degree], from which the reflection points are searched.
    of : array (path,) of int
        Number of the cylinder of each path, ascending; each has one.
    start : array (cylinder, 3)
        East and north of the centre, and signed radius [m].

    Returns
    -------
    parameters : array (cylinder, 3)
        NaN where the paths determine none.
    covariance : array (cylinder, 3, 3)
    """
    fitted, covariance = np.full(start.shape, np.nan), np.broadcast_to(np.eye(3), (len(start), 3, 3)).copy()
    near, parameters, number = normal, start, np.arange(len(start))
    for taken in range(MAX_STEPS):
        found, residual = _compare(paths, near, parameters[of])
        usable = np.isfinite(residual[:, 0])
        near = np.where(usable, found.normal, normal)
        slopes = np.stack([found.length_slopes, found.azimuth_slopes], axis=1) / _std(paths)[:, :, None]
        weight = np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(residual), HUBER_THRESHOLD))
        slopes, residual, weight = (
            np.where(usable.reshape(-1, *[1] * (x.ndim - 1)), x, 0.0) for x in (slopes, residual, weight)
        )
        pulled = (slopes * weight[:, :, None]).swapaxes(-1, -2)
        starts = np.searchsorted(of, np.arange(len(number)))
        matrix = np.add.reduceat(pulled @ slopes, starts)
        inverse = np.linalg.pinv(matrix, hermitian=True)
        step = (inverse @ np.add.reduceat(pulled @ residual[:, :, None], starts))[:, :, 0]
        # a radius does not change its sign through 0, nor by more than half at once
        share = np.minimum(1.0, np.abs(parameters[:, 2]) / 2 / np.maximum(np.abs(step[:, 2]), 1e-12))
        parameters = parameters + share[:, None] * step
        done = (share == 1) & (np.einsum("ni,nij,nj->n", step, matrix, step) < STEP_TOLERANCE**2)
        done |= (taken + 1 == MAX_STEPS) | ~(np.linalg.det(inverse) > 0)
        fitted[number[done]], covariance[number[done]] = parameters[done], inverse[done]
        left = ~done
        if not left.any():
            break
        parameters, number, rows = parameters[left], number[left], left[of]
        paths, normal, near = paths.take(rows), normal[rows], near[rows]
        of = (np.cumsum(left) - 1)[of[rows]]
    fitted[~(np.linalg.det(covariance) > 0)] = np.nan
    return fitted, covariance


def compared(
    paths: Paths, normal: FloatArray, centre: FloatArray, radius: float, covariance: FloatArray
) -> CylinderFit:
    """Paths against a cylinder."""
    shapes = np.tile([*centre, radius], (len(paths), 1))
    return CylinderFit(centre, radius, covariance, *compared_with_each(paths, normal, shapes))


def compared_with_each(
    paths: Paths, normal: FloatArray, parameters: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Paths, each against a cylinder (path, 3) of its own: chi-squared, normal, point and loss as in `CylinderFit`."""
    found, residual = _compare(paths, normal, parameters)
    chi2 = np.where(np.isfinite(residual[:, 0]), np.sum(residual**2, axis=-1), np.inf)
    s1 = np.linalg.norm(found.point - paths.tx[:, :2], axis=-1)
    height = paths.tx[:, 2] + (paths.rx[:, 2] - paths.tx[:, 2]) * s1 / found.length
    cos_elevation = found.length / np.hypot(found.length, paths.tx[:, 2] - paths.rx[:, 2])
    with np.errstate(invalid="ignore"):
        factor = spreading_factor(
            s1 / cos_elevation,
            (found.length - s1) / cos_elevation,
            parameters[:, 2],
            found.cosine * cos_elevation,
            cos_elevation,
        )
    return chi2, found.normal, np.column_stack([found.point, height]), -10 * np.log10(factor)


def _compare(paths: Paths, normal: FloatArray, parameters: FloatArray) -> tuple[Bounce, FloatArray]:
    """Reflections off cylinders (path, 3), and measured minus predicted length and azimuth (path, 2) in errors."""
    found = bounce(paths.tx, paths.rx, parameters[:, :2], parameters[:, 2], normal)
    slant = np.hypot(found.length, paths.tx[:, 2] - paths.rx[:, 2])
    residual = np.stack([paths.length - slant, angle_difference(paths.azimuth, found.azimuth)], axis=-1)
    flat = (found.length / slant)[:, None]
    return found._replace(length_slopes=found.length_slopes * flat), residual / _std(paths)


def _std(paths: Paths) -> FloatArray:
    return np.stack([paths.length_std, paths.azimuth_std], axis=-1)
