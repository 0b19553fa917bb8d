"""Fit lines to paths, and measure how well paths agree with lines; many lines at once."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.clutter import CHI_SQUARED_GATE as CHI_SQUARED_GATE
from erm.reconstruction.model.line import Frame, Line, Lines
from erm.reconstruction.model.paths import IntArray, PathColumns, Paths
from erm.reconstruction.model.ragged import Ragged, list_sums

HUBER_THRESHOLD = 2.0
"""Standard errors beyond which a residual pulls with constant force (99 % efficient on Gaussian errors)."""
MAX_STEPS = 30
"""Gauss-Newton steps of a fit at most; five are usual. Chosen; not derived."""
STEP_TOLERANCE = 1e-11
"""Step below which a fit has converged [degree, m]: rounding errors are as large."""
BATCH_PATHS = 32768
"""Paths worked on at once: few enough for the processor's cache. Chosen; not derived."""

Covariance = tuple[FloatArray | float, FloatArray | float, FloatArray | float]
EXACT_LINE: Covariance = (0.0, 0.0, 0.0)
"""Covariance of a line that is taken as exact, see `chi_squared`."""


class Residuals(NamedTuple):
    """Measured minus predicted length and azimuth (path,), and slopes of the predictions by (normal, offset)."""

    length: FloatArray  # m
    azimuth: FloatArray  # degree
    length_by_normal: FloatArray
    length_by_offset: FloatArray
    azimuth_by_normal: FloatArray
    azimuth_by_offset: FloatArray


def residuals(paths: PathColumns, frame: Frame) -> Residuals:
    """Compare paths with what a line predicts, or each path with a line of its own.

    With ``n`` the normal, ``m`` the unit vector to its left and ``o`` the offset, the virtual anchor
    ``VA = tx + 2 (o - n.tx) n`` moves by ``2 (o - n.tx) m - 2 (m.tx) n`` per radian and by ``2 n`` per metre.
    """
    nx, ny, offset, px, py = frame  # m is (-ny, nx)
    tx_east, tx_north = paths.tx_east - px, paths.tx_north - py
    depth = offset - tx_east * nx - tx_north * ny
    aside = tx_north * nx - tx_east * ny
    east = tx_east - (paths.rx_east - px) + 2 * depth * nx
    north = tx_north - (paths.rx_north - py) + 2 * depth * ny
    square = east * east + north * north  # np.hypot takes ten times as long; lengths in metres do not overflow
    horizontal, slant = np.sqrt(square), np.sqrt(square + paths.height_difference**2)
    cosine, sine = east / horizontal, north / horizontal
    toward_n, toward_m = cosine * nx + sine * ny, sine * nx - cosine * ny
    doubled_cos_elevation = 2 * horizontal / slant
    # the left of the line of sight is (-sine, cosine): along n and m it is -toward_m and toward_n
    return Residuals(
        length=paths.length - slant,
        azimuth=angle_difference(paths.azimuth, np.rad2deg(np.arctan2(north, east))),
        length_by_normal=np.deg2rad(depth * toward_m - aside * toward_n) * doubled_cos_elevation,
        length_by_offset=toward_n * doubled_cos_elevation,
        azimuth_by_normal=2 * (depth * toward_n + aside * toward_m) / horizontal,
        azimuth_by_offset=np.rad2deg(-2 * toward_m / horizontal),
    )


def chi_squared(paths: PathColumns, residual: Residuals, covariance: Covariance) -> FloatArray:
    """Chi-squared ``r' (S + J C J')**-1 r`` (path,) of residuals in length and azimuth.

    ``S`` is the paths' own covariance, ``J`` holds the slopes of the predictions and ``C`` is the ``covariance`` of the
    line: (variance of the normal, covariance, variance of the offset), numbers or arrays (path,).
    """
    r, s, rn, ro, sn, so = residual
    normal, both, offset = covariance
    of_normal, of_offset = rn * normal + ro * both, rn * both + ro * offset
    length = of_normal * rn + of_offset * ro + paths.length_std**2
    mixed = of_normal * sn + of_offset * so
    azimuth = sn * sn * normal + 2 * sn * so * both + so * so * offset + paths.azimuth_std**2
    return (r * r * azimuth - 2 * r * s * mixed + s * s * length) / (length * azimuth - mixed**2)


def misfit(paths: Paths, line: Line) -> FloatArray:
    """Chi-squared (path,) of each path against a wall, the uncertainty of the wall included.

    Infinite where an antenna is behind the wall.
    """
    (a, b), (_, d) = line.covariance.tolist()
    return _misfit(paths.columns, line.frame(), (a, b, d))


def misfits(paths: PathColumns, rows: IntArray, lines: Lines, of: IntArray) -> FloatArray:
    """`misfit` (row,) of rows of the paths, each against the line ``of`` (row,) of many."""
    found = np.empty(len(rows))
    frames = np.stack(lines.frames())
    covariances = np.ascontiguousarray(lines.covariance[:, [0, 0, 1], [0, 1, 1]].T)
    for first in range(0, len(rows), BATCH_PATHS):
        part = slice(first, first + BATCH_PATHS)
        own = of[part]
        a, b, d = (column[own] for column in covariances)
        found[part] = _misfit(paths.take(rows[part]), Frame(*(column[own] for column in frames)), (a, b, d))
    return found


def _misfit(paths: PathColumns, frame: Frame, covariance: Covariance) -> FloatArray:
    chi2 = chi_squared(paths, residuals(paths, frame), covariance)
    tx = frame.signed_distance_at(paths.tx_east, paths.tx_north)
    rx = frame.signed_distance_at(paths.rx_east, paths.rx_north)
    chi2[~(np.minimum(tx, rx) > 0)] = np.inf
    return chi2


def fit_line(paths: Paths, start: Line, steps: int = MAX_STEPS) -> Line:
    """Most likely wall of a set of paths, from a nearby start; see `fit_lines`."""
    inliers = Ragged(np.arange(len(paths)), np.array([0, len(paths)]))
    return fit_lines(paths.columns, inliers, Lines.from_list([start]), np.array([steps])).line(0)


def fit_lines(paths: PathColumns, inliers: Ragged, starts: Lines, steps: IntArray | int = MAX_STEPS) -> Lines:
    """Most likely walls of sets of paths, by reweighted Gauss-Newton steps from nearby starts.

    Each fit minimises the sum over its paths of ``h((L - L(wall)) / s_L) + h((a - a(wall)) / s_a)`` with Huber's ``h``:
    quadratic up to `HUBER_THRESHOLD` standard errors and linear beyond. A wrong path, or one whose delay is biased by
    another path, thus does not bend the wall. The covariance is the inverse of the weighted normal matrix: it assumes
    that the standard errors are right.

    Parameters
    ----------
    paths : PathColumns
    inliers : Ragged
        Paths of each wall; none is empty.
    starts : Lines
    steps : array (wall,) or int
        Maximum number of steps of each fit.
    """
    steps = np.broadcast_to(steps, len(inliers))
    parts = []
    for part in inliers.batches(BATCH_PATHS):
        own = inliers.batch(part)
        parts.append(_fit_batch(paths.take(own.rows), own.start, starts.take(part), steps[part]))
    return Lines(*(np.concatenate(columns) for columns in zip(*parts, strict=True))) if parts else starts


def _fit_batch(paths: PathColumns, start: IntArray, lines: Lines, steps: IntArray) -> Lines:
    """Fit each line to consecutive paths, the first to those from ``start[0]`` to ``start[1]``."""
    active = Ragged(np.arange(start[-1]), start)
    of = active.owner
    east, north = lines.frames(of).reflection_points(paths)
    lines = lines.with_pivot(list_sums(np.stack([east, north], axis=-1), start) / active.sizes[:, None])
    fitted, number, taken = lines, np.arange(len(active)), 0
    while len(number):
        lines, step = _step(paths, of, active.start, lines)
        taken += 1
        done = (np.abs(step).max(axis=1) < STEP_TOLERANCE) | (taken >= steps)
        if done.any():
            fitted = fitted.with_replaced(number[done], lines.take(done))
            rest = np.flatnonzero(~done)
            number, lines, steps, active = number[rest], lines.take(rest), steps[rest], active.take(rest)
            paths = paths.take(active.rows)
            active = Ragged(np.arange(active.start[-1]), active.start)
            of = active.owner
    return fitted


def _step(paths: PathColumns, of: IntArray, start: IntArray, lines: Lines) -> tuple[Lines, FloatArray]:
    """Lines after one Gauss-Newton step, with their covariances before it, and the steps (line, 2)."""
    residual = residuals(paths, lines.frames(of))
    terms = np.zeros((5, len(of)))
    for value, by_normal, by_offset, std in (
        (residual.length, residual.length_by_normal, residual.length_by_offset, paths.length_std),
        (residual.azimuth, residual.azimuth_by_normal, residual.azimuth_by_offset, paths.azimuth_std),
    ):
        weight = np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(value / std), HUBER_THRESHOLD)) / std**2
        of_normal, of_offset = weight * by_normal, weight * by_offset
        terms[0] += of_normal * by_normal
        terms[1] += of_normal * by_offset
        terms[2] += of_offset * by_offset
        terms[3] += of_normal * value
        terms[4] += of_offset * value
    a, b, d, u, v = np.add.reduceat(terms, start[:-1], axis=1)
    determinant = a * d - b * b
    covariance = np.stack([d, -b, -b, a], axis=-1).reshape(-1, 2, 2) / determinant[:, None, None]
    step = np.stack([d * u - b * v, a * v - b * u], axis=-1) / determinant[:, None]
    return Lines((lines.normal + step[:, 0]) % 360, lines.offset + step[:, 1], covariance, lines.pivot), step
