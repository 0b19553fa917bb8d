"""False alarms: where paths are many and their errors large, some of them always share an image by chance.

One number tells images from chance, the evidence of all paths of a candidate together: what each path that agrees is
worth depends on its own errors, and on how many paths as strong its antenna pair has about it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import betaln

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.line import PLANE_SPAN
from erm.reconstruction.model.loss import log_odds_of_loss
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.model.ragged import Ragged
from erm.reconstruction.model.wall import Wall

DISTURBED_SHARE = 0.1
"""Share of inliers that other paths disturb, so that they lie anywhere in the gate. Chosen; not derived."""


def evidence(walls: Sequence[Wall]) -> FloatArray:
    """Log odds (wall,) of candidates to be images and no false alarms.

    About its prediction, a path off an image has the density ``exp(-chi2 / 2) / (2 pi s_L s_a)`` of lengths and
    azimuths, the losses of faces and the elevation of a vertical one; by chance it has the density of
    `erm.reconstruction.model.clutter`, and any loss and elevation.
    Each inlier adds the logarithm of the ratio ``q``, of ``(1 - DISTURBED_SHARE) q + DISTURBED_SHARE`` as others
    disturb some. The line costs ``ln(2 pi sqrt|C| / V)``: with the covariance ``C`` of its fit it is one of so many in
    the volume ``V`` of all normals and of `PLANE_SPAN` offsets (Laplace's method). Two paths fit any line and pay this
    about; a path with errors as large as its surroundings is worth nothing. That just these links received something,
    of those that the line would reflect to between its outermost reflection points and over no longer paths, has
    the probability `log_probability_of_view`.
    """
    inliers, odds = _log_odds_of_paths(walls)
    if not walls:
        return np.empty(0)
    paths = walls[0].all_paths
    disturbed = np.logaddexp(np.log(1 - DISTURBED_SHARE) + odds, np.log(DISTURBED_SHARE))
    total = np.bincount(inliers.owner, disturbed, len(walls)) + np.log(2 * np.pi / (360 * PLANE_SPAN))
    total += [np.linalg.slogdet(wall.line.covariance)[1] / 2 for wall in walls]
    possible = np.flatnonzero(total > 0)  # the others are false alarms in any view
    links = paths.take(np.unique(paths.link, return_index=True)[1]) if len(possible) else paths
    for number in possible.tolist():
        total[number] += log_probability_of_view(walls[number].support, _in_view(walls[number], links))
    return np.asarray(total)


def _log_odds_of_paths(walls: Sequence[Wall]) -> tuple[Ragged, FloatArray]:
    """Inliers of each candidate, and the log odds (inlier,) of each to be off the image and not there by chance."""
    inliers = Ragged.from_lists([wall.inliers for wall in walls])
    if not walls:
        return inliers, np.empty(0)
    at_best = log_odds_at_best(walls[0].all_paths.take(inliers.rows))
    return inliers, at_best - np.concatenate([wall.chi_squared for wall in walls]) / 2


def _in_view(wall: Wall, links: Paths) -> int:
    """Number of links that a candidate would reflect to, between its inliers and over paths no longer than theirs."""
    frame, own = wall.line.frame(), wall.paths
    along = frame.along(wall.reflection_points)
    columns = links.columns
    near = frame.signed_distance_at(columns.rx_east, columns.rx_north)
    far = frame.signed_distance_at(columns.tx_east, columns.tx_north)
    in_front = np.flatnonzero(np.minimum(near, far) > 0)
    near, far = near[in_front], far[in_front]
    of_rx = frame.along_at(columns.rx_east[in_front], columns.rx_north[in_front])
    aside = frame.along_at(columns.tx_east[in_front], columns.tx_north[in_front]) - of_rx
    place = of_rx + near / (near + far) * aside
    squared = (near + far) ** 2 + aside**2 + columns.height_difference[in_front] ** 2
    seen = (place > along.min()) & (place < along.max()) & (squared < own.length.max() ** 2)
    return wall.support + len(np.setdiff1d(links.link[in_front[seen]], own.link, assume_unique=True))


def log_probability_of_view(received: int, in_view: int) -> float:
    """Log probability that just these of the links in view of a place receive something from it.

    A few of many links find clutter that agrees anywhere. If every share of receiving links is equally likely
    beforehand, ``k`` of ``n`` receive with the probability ``B(k + 1, n - k + 1)``, off a pole or an image.
    """
    return float(betaln(received + 1, max(in_view - received, 0) + 1))


def log_odds_at_best(paths: Paths) -> FloatArray:
    """Log odds (path,) of paths to be off an image that they agree with exactly, and not there by chance."""
    chance = 2 * np.pi * paths.length_std * paths.azimuth_std * paths.clutter
    of_place = -np.log(np.maximum(chance, np.finfo(float).tiny))
    return np.asarray(of_place + log_odds_of_loss(paths.loss, paths.loss_std) + paths.elevation_log_odds)


def without_worthless(walls: Sequence[Wall]) -> list[Wall]:
    """Candidates without the paths that may well be there by chance: they show neither a wall nor its length."""
    inliers, log_odds = _log_odds_of_paths(walls)
    worth = inliers.masked(log_odds > TWENTY_TO_ONE)
    return [replace(wall, inliers=own) for wall, own in zip(walls, worth, strict=True)]
