"""Right-angled corners with one wall that was never measured alone: double reflections show them.

Two mirrors at a right angle commute. Together they turn the plane by half a turn about their corner. The image
therefore lies as far beyond the corner as the transmitter lies before it, whichever wall comes first, and the corner
lies on both walls.
"""

from collections.abc import Sequence

import numpy as np

from erm.geometry.vertical import angle_difference, unit
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.decision.multi_bounce import FACADE_ROUGHNESS
from erm.reconstruction.model.line import mirror_images
from erm.reconstruction.model.loss import loss_error, median_loss
from erm.reconstruction.model.wall import Wall

MAX_CORNER_ERROR = 0.2
"""Uncertainty up to which a corner is tested [m]; a less certain one lies on some wall by chance. Chosen; not
derived."""
MIN_CORNER_ANGLE = 3.0
"""Angle below which two walls are parallel [degree]. Chosen; not derived."""
CORNER_LOSS_TOLERANCE = 1.0
"""By how much less than its known wall a double reflection may seem to lose [dB]. Chosen; not derived."""


def corner_pairs(walls: Sequence[Wall]) -> list[tuple[int, int]]:
    """Find candidates that are double reflections off a known wall and a hidden one at a right angle to it.

    Halfway between transmitter and image lies the foot of the perpendicular from the transmitter to a wall. For a real
    wall this point lies on another wall's line, to a few centimetres, by chance only.

    Returns
    -------
    list of (candidate, known wall)
    """
    found = []
    losses = [(median_loss(wall), loss_error(wall)) for wall in walls]
    normals = np.array([wall.line.normal for wall in walls])
    offsets = np.array([wall.line.offset for wall in walls])
    pivots = np.array([wall.line.pivot for wall in walls]).reshape(-1, 2)
    covariances = np.array([wall.line.covariance for wall in walls]).reshape(-1, 2, 2)
    support = np.array([wall.support for wall in walls])
    transmitters = [wall.paths.transmitter for wall in walls]
    for one, wall in enumerate(walls):
        if len(np.unique(transmitters[one])) > 1:  # a line does not describe a chain for several transmitters
            continue
        tx = wall.paths.tx[0, :2]
        corner = (tx + mirror_images(wall.line, tx)) / 2
        apart = corner - pivots
        distance = np.sum(unit(normals) * apart, axis=-1) - offsets
        along = np.sum(unit(normals + 90) * apart, axis=-1)
        slope = np.stack([np.deg2rad(along), -np.ones(len(walls))], axis=-1)
        of_known = np.einsum("np,npq,nq->n", slope, covariances, slope)
        n, m = unit(wall.line.normal), unit(wall.line.normal + 90)
        from_tx = wall.line.offset - float((tx - wall.line.pivot) @ n)
        # slope of the foot tx + (o - n.t) n, t = tx - pivot, by the normal
        turn = np.deg2rad(from_tx * m - float((tx - wall.line.pivot) @ m) * n)
        own = np.stack([unit(normals) @ turn, unit(normals) @ n], axis=-1)
        variance = of_known + np.einsum("np,pq,nq->n", own, wall.line.covariance, own)
        tolerance = SIGMAS * np.sqrt(variance) + FACADE_ROUGHNESS
        angle = np.abs(angle_difference(2 * normals, 2 * wall.line.normal)) / 2
        near = (np.abs(distance) < tolerance) & (tolerance < MAX_CORNER_ERROR)
        near &= (angle > MIN_CORNER_ANGLE) & (support >= wall.support)
        for other in np.flatnonzero(near).tolist():
            error = np.hypot(losses[one][1], losses[other][1])
            if losses[one][0] > losses[other][0] - CORNER_LOSS_TOLERANCE - error:
                found.append((one, other))
    return found
