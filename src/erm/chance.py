"""Groups that agree by chance: where paths are many and their errors wide, some always point to one image.

As an astronomer counts photons beside a star: the paths just outside the gate of a line tell how many are inside it without
any wall.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import gammainc

from erm.consensus import GATE, REACH, Images
from erm.geometry import FloatArray
from erm.wall import Wall, anchors, misfit

RING = 3.0  # outer radius of the ring that is counted, in radii of the gate
FREE = 2  # members that agree because the line was laid through them


def expected_accidents(walls: Sequence[Wall]) -> FloatArray:
    """Number (wall,) of groups as large as each candidate that paths from nowhere would make.

    With ``n`` paths in the ring from one to `RING` radii of the gate, the gate holds ``m = n / (RING**2 - 1)`` by chance.
    Each of the ``N`` paths starts a search, so ``N P(Poisson(m) >= support - FREE)`` groups are to be expected. Members of
    larger candidates are accounted for and do not count.
    """
    if not walls:
        return np.empty(0)
    paths = walls[0].all_paths
    images = Images(paths)
    size = np.zeros(len(paths), dtype=np.int64)
    for wall in walls:
        size[wall.members] = np.maximum(size[wall.members], wall.support)
    radius = RING * REACH * float(images.across.max() + images.along.max())
    accidents = np.zeros(len(walls))
    for number, wall in enumerate(walls):
        front = np.flatnonzero(wall.line.depth(images.transmitters) > 0)
        near = images.around(anchors(wall.line, images.transmitters[front]), front, radius)
        near = near[(size[near] <= wall.support) & ~np.isin(near, wall.members)]
        chi2 = misfit(paths.take(near), wall.line)
        chance = np.count_nonzero((chi2 > GATE) & (chi2 < RING**2 * GATE)) / (RING**2 - 1)
        # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
        accidents[number] = len(paths) * gammainc(max(wall.support - FREE, 1), chance)
    return accidents
