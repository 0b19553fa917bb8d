"""Groups that agree by chance: where paths are many and their errors wide, some always point to one image.

As an astronomer counts photons beside a star: the paths just outside the gate of a line tell how many would be inside
it without any wall.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import gammainc

from erm.geometry import FloatArray
from erm.walls.fit import misfit
from erm.walls.images import GATE, REACH, Images
from erm.walls.line import anchors
from erm.walls.wall import Wall

RING = 3.0  # outer radius of the ring that is counted, in radii of the gate
ASTRAY = 0.1  # share of members that others disturbed
UNSEEN = 0.5  # paths; Jeffreys: where none was counted the rate is not nought
FREE = 2  # members that agree because the line was laid through them


def odds_against_chance(walls: Sequence[Wall], asked: Sequence[bool]) -> FloatArray:
    """Log odds (wall,) of the candidates asked for to be one image and not an accident; infinite for the others.

    With ``n`` paths in the ring from one to `RING` radii of the gate, the gate holds ``m = (n + 1/2) / (RING**2 - 1)``
    by chance, and of ``N`` searches, one from each path, ``N P(Poisson(m) >= support - FREE)`` find as large a group.
    Chance also spreads its members evenly over the gate, while chi-squared of true ones is of 2 degrees of freedom:
    each adds the logarithm of ``(1 - ASTRAY) GATE / 2 exp(-chi2 / 2) + ASTRAY``. Members of larger candidates are
    accounted for and do not count as paths from nowhere.
    """
    odds = np.full(len(walls), np.inf)
    if not any(asked):
        return odds
    paths = walls[0].all_paths
    images = Images(paths)
    size = np.zeros(len(paths), dtype=np.int64)
    for wall in walls:
        size[wall.members] = np.maximum(size[wall.members], wall.support)
    radius = RING * REACH * float(images.across.max() + images.along.max())
    for number in np.flatnonzero(asked).tolist():
        wall = walls[number]
        front = np.flatnonzero(wall.line.depth(images.transmitters) > 0)
        near = np.sort(images.around(anchors(wall.line, images.transmitters[front]), front, radius).rows)
        near = near[(size[near] <= wall.support) & ~np.isin(near, wall.members)]
        chi2 = misfit(paths.take(near), wall.line)
        chance = (np.count_nonzero((chi2 > GATE) & (chi2 < RING**2 * GATE)) + UNSEEN) / (RING**2 - 1)
        # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
        accidents = len(paths) * gammainc(max(wall.support - FREE, 1), chance)
        fit = (1 - ASTRAY) * GATE / 2 * np.exp(-wall.misfits / 2) + ASTRAY
        odds[number] = np.log(fit).sum() - np.log(max(accidents, 1.0))
    return odds
