"""Joint adjustment: the lines of all walls are fitted to all their reflections, chains included.

Each reflection of a chain moves its image by twice the error of a wall, and later reflections in a street meet its
walls more steeply than the first. A few chains may determine a wall better than all single reflections off it. Once it
is known which images are walls, the lines of all walls are therefore fitted together to their own paths and to those
that were reflected off two or three of them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.decision.chains import Chains, ChainSearch, predict_chains
from erm.reconstruction.model.fit import HUBER_THRESHOLD, MAX_STEPS
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.model.ragged import concatenate_rows
from erm.reconstruction.model.wall import Wall

MAX_ADJUSTMENTS = 3
"""Repetitions of searching chains and fitting: the lines of one find the chains of the next. Chosen; not derived."""
STEP_TOLERANCE = 1e-9
"""Step below which the joint fit has converged [degree, m]. Chosen; not derived."""


def adjust_walls(walls: Sequence[Wall], paths: Paths, max_gap: float) -> tuple[list[Wall], IntArray]:
    """Fit all walls together to their inliers and to the chains among other paths.

    Parameters
    ----------
    walls : sequence of Wall
        All walls of the map.
    paths : Paths
        Inliers of none, that vertical walls may have reflected.
    max_gap : float
        How far beyond its outermost reflection points a wall may reflect [m].

    Returns
    -------
    walls : list of Wall
    rows : array (n,) of int
        Rows of the chains in the table.
    """
    none = np.empty(0, dtype=np.int64)
    if len(walls) < 2 or not len(paths):
        return list(walls), none
    lines = Lines.from_list([wall.line for wall in walls])
    count = len(walls)
    covariance = np.zeros((count, 2, count, 2))
    covariance[np.arange(count), :, np.arange(count)] = lines.covariance
    single = [Chains(wall.paths, np.full((wall.support, 1), number)) for number, wall in enumerate(walls)]
    search = ChainSearch(walls, paths, max_gap)
    found: list[Chains] = []
    for _ in range(MAX_ADJUSTMENTS):
        before, found = found, search.find(lines, covariance)
        if not found:
            return list(walls), none
        lines, covariance = fit_jointly([*single, *found], lines)
        if [chains.paths.row.tolist() for chains in before] == [chains.paths.row.tolist() for chains in found]:
            break
    lines = lines._replace(covariance=lines.covariance * shared_error_factor([*single, *found], lines, covariance))
    return (
        [replace(wall, line=lines.line(number)) for number, wall in enumerate(walls)],
        concatenate_rows(chains.paths.row for chains in found),
    )


def fit_jointly(sets: Sequence[Chains], lines: Lines) -> tuple[Lines, FloatArray]:
    """Most likely lines of all walls together, and their covariance (wall, 2, wall, 2).

    As in `erm.reconstruction.model.fit.fit_lines`, residuals beyond `HUBER_THRESHOLD` standard errors pull with
    constant force.
    """
    count = len(lines.normal)
    covariance = np.zeros((2 * count, 2 * count))
    for _ in range(MAX_STEPS):
        normal, gradient = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
        for slope, residual, _ in _weighted_residuals(sets, lines):
            normal += slope.T @ slope
            gradient += slope.T @ residual
        scale = 1 / np.sqrt(np.diag(normal))
        covariance = np.linalg.inv(normal * scale[:, None] * scale) * scale[:, None] * scale
        step = (covariance @ gradient).reshape(count, 2)
        lines = lines._replace(normal=(lines.normal + step[:, 0]) % 360, offset=lines.offset + step[:, 1])
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    joint = covariance.reshape(count, 2, count, 2)
    return lines._replace(covariance=joint[np.arange(count), :, np.arange(count)]), joint


def shared_error_factor(sets: Sequence[Chains], lines: Lines, covariance: FloatArray) -> float:
    """Factor of the variances for errors that all paths of a link share, such as those of its antennas' positions.

    If all errors were independent, the gradients ``g`` of the links would add up to ``sum g'C g`` equal to the number
    of parameters. The ratio of the two is returned if it exceeds 1 by more than two standard errors; otherwise 1.
    """
    size = 2 * len(lines.normal)
    gradients, links = [], []
    for slope, residual, link in _weighted_residuals(sets, lines):
        gradients.append(slope * residual[:, None])
        links.append(link)
    _, of = np.unique(np.concatenate(links), return_inverse=True)
    of_link = np.zeros((of.max() + 1, size))
    np.add.at(of_link, of, np.concatenate(gradients))
    ratio = np.einsum("lp,pq,lq->l", of_link, covariance.reshape(size, size), of_link) / size
    lower_bound = float(ratio.sum() - 2 * np.sqrt(np.sum((ratio - ratio.mean()) ** 2)))
    return float(ratio.sum()) if lower_bound > 1 else 1.0


def _weighted_residuals(sets: Sequence[Chains], lines: Lines) -> Iterator[tuple[FloatArray, FloatArray, IntArray]]:
    """Slopes (path, 2 wall) and residuals (path,) of lengths and azimuths, in standard errors, and links (path,)."""
    for paths, walls in sets:
        found = predict_chains(paths.tx, paths.rx, walls, lines)
        column = 2 * walls[:, :, None] + np.arange(2)
        for residual, slope, std in (
            (paths.length - found.length, found.length_slope, paths.length_std),
            (angle_difference(paths.azimuth, found.azimuth), found.azimuth_slope, paths.azimuth_std),
        ):
            # the slopes of a wall that was met twice add up
            row = np.zeros((len(paths), 2 * len(lines.normal)))
            np.add.at(row, (np.arange(len(paths))[:, None, None], column), slope)
            weight = np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(residual / std), HUBER_THRESHOLD))
            weight = np.sqrt(weight) / std
            yield row * weight[:, None], residual * weight, paths.link
