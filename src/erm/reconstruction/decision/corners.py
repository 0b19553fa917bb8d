"""Right-angled corners, of which one wall was never seen alone: their double bounces give themselves away.

Two mirrors at a right angle commute, and together turn the plane by half a turn about their corner. So the image lies
as far beyond the corner as the transmitter before it, whichever wall comes first, and the corner lies on both.
"""

from collections.abc import Sequence

import numpy as np

from erm.geometry.vertical import angle_difference, unit
from erm.reconstruction.model.line import anchors
from erm.reconstruction.model.loss import loss_error, typical_loss
from erm.reconstruction.model.wall import Wall

SHARP = 0.2  # m; a corner known worse than this lies on some wall by accident
SMOOTH = 2e-3  # m; facades are not mirrors to better than this
ALONG = 3.0  # degree; a wall turned less than this from another runs along it
GAIN = 1.0  # dB; two bounces lose no less than the one of them that is known


def corners_on(walls: Sequence[Wall]) -> list[tuple[int, int]]:
    """Pairs (one, known) where one is a double bounce off a known wall and a hidden one at right angles to it.

    Half-way between transmitter and image is the foot of the perpendicular from the transmitter to a wall that is one.
    That it falls onto another wall's line within centimetres happens to a real wall by accident only.
    """
    found = []
    losses = [(typical_loss(wall), loss_error(wall)) for wall in walls]
    normals = np.array([wall.line.normal for wall in walls])
    offsets = np.array([wall.line.offset for wall in walls])
    pivots = np.array([wall.line.pivot for wall in walls]).reshape(-1, 2)
    covariances = np.array([wall.line.covariance for wall in walls]).reshape(-1, 2, 2)
    support = np.array([wall.support for wall in walls])
    transmitters = [wall.paths.transmitter for wall in walls]
    for one, wall in enumerate(walls):
        if len(np.unique(transmitters[one])) > 1:  # the image of a chain is not that of a line for other transmitters
            continue
        tx = wall.paths.tx[0, :2]
        corner = (tx + anchors(wall.line, tx)) / 2
        apart = corner - pivots
        depth = np.sum(unit(normals) * apart, axis=-1) - offsets
        along = np.sum(unit(normals + 90) * apart, axis=-1)
        slope = np.stack([np.deg2rad(along), -np.ones(len(walls))], axis=-1)
        known = np.einsum("np,npq,nq->n", slope, covariances, slope)
        n, m = unit(wall.line.normal), unit(wall.line.normal + 90)
        before = wall.line.offset - float((tx - wall.line.pivot) @ n)
        # the foot moves along the wall as it turns about the transmitter, and with it
        turn = np.deg2rad(before * m - float((tx - wall.line.pivot) @ m) * n)
        own = np.stack([unit(normals) @ turn, unit(normals) @ n], axis=-1)
        spread = known + np.einsum("np,pq,nq->n", own, wall.line.covariance, own)
        reach = 3 * np.sqrt(spread) + SMOOTH
        turned = np.abs(angle_difference(2 * normals, 2 * wall.line.normal)) / 2
        near = (np.abs(depth) < reach) & (reach < SHARP) & (turned > ALONG) & (support >= wall.support)
        for other in np.flatnonzero(near).tolist():
            doubt = np.hypot(losses[one][1], losses[other][1])
            if losses[one][0] > losses[other][0] - GAIN - doubt:
                found.append((one, other))
    return found
