"""Groups that agree by chance: where paths are many and their errors wide, some always point to one image.

As an astronomer counts photons beside a star: the paths just outside the gate of a line tell how many would be inside
it without any wall.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import gammainc

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import misfits
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.images import GATE, Images

RING = 3.0  # outer radius of the ring that is counted, in radii of the gate
ASTRAY = 0.1  # share of members that others disturbed
UNSEEN = 0.5  # paths; Jeffreys: where none was counted the rate is not nought
FREE = 2  # members that agree because the line was laid through them
PLENTY = 40  # links that never agree by chance
THOUSAND = 6.9  # log odds
LINES = 64  # looked at in one go


def odds_against_chance(walls: Sequence[Wall], asked: Sequence[bool]) -> FloatArray:
    """Log odds (wall,) of the candidates asked for to be one image and not an accident; infinite for the others.

    With ``n`` paths in the ring from one to `RING` radii of the gate, the gate holds ``m = (n + 1/2) / (RING**2 - 1)``
    by chance, and of ``N`` searches, one from each path, ``N P(Poisson(m) >= support - FREE)`` find as large a group.
    Chance also spreads its members evenly over the gate, while chi-squared of true ones is of 2 degrees of freedom:
    each adds the logarithm of ``(1 - ASTRAY) GATE / 2 exp(-chi2 / 2) + ASTRAY``. Members of larger candidates are
    accounted for and do not count as paths from nowhere.
    """
    return _odds(walls, np.flatnonzero(asked))[0]


def accidental(walls: Sequence[Wall]) -> BoolArray:
    """Candidates (wall,) that are a thousand times likelier to be accidents than images.

    Where paths from nowhere are so many that each image has others beside it, groups of three or four outnumber walls.
    """
    few = np.flatnonzero([wall.support < PLENTY for wall in walls])
    odds, accidents = _odds(walls, few)
    return (odds < -THOUSAND) & (accidents > 1)


def _odds(walls: Sequence[Wall], some: IntArray) -> tuple[FloatArray, FloatArray]:
    """Log odds (wall,) of some of the candidates, and how many accidents (wall,) make as large a group."""
    odds, accidents = np.full(len(walls), np.inf), np.zeros(len(walls))
    if not len(some):
        return odds, accidents
    support = np.array([wall.support for wall in walls], dtype=np.int64)
    paths = walls[0].all_paths
    chance = (_about(Images(paths), walls, some) + UNSEEN) / (RING**2 - 1)
    # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
    accidents[some] = len(paths) * gammainc(np.maximum(support[some] - FREE, 1), chance)
    fit = [np.log((1 - ASTRAY) * GATE / 2 * np.exp(-walls[i].misfits / 2) + ASTRAY).sum() for i in some.tolist()]
    odds[some] = np.array(fit) - np.log(np.maximum(accidents[some], 1.0))
    return odds, accidents


def _about(images: Images, walls: Sequence[Wall], some: IntArray) -> IntArray:
    """Number of paths in the ring about each of some walls that no larger wall accounts for."""
    paths = images.paths
    support = np.array([wall.support for wall in walls], dtype=np.int64)
    size, owner = np.zeros(len(paths), dtype=np.int64), np.full(len(paths), -1)
    for number, wall in enumerate(walls):
        larger = wall.members[size[wall.members] < wall.support]
        size[larger], owner[larger] = wall.support, number
    images = images.without(size <= support[some].max())
    counts = []
    for first in range(0, len(some), LINES):
        part = some[first : first + LINES]
        lines = Lines.of([walls[i].line for i in part.tolist()])
        of, rows = images.about(lines, RING)
        free = np.flatnonzero((size[rows] <= support[part[of]]) & (owner[rows] != part[of]))
        of, rows = of[free], rows[free]
        chi2 = misfits(paths.rays, rows, lines, of)
        counts.append(np.bincount(of[(chi2 > GATE) & (chi2 < RING**2 * GATE)], minlength=len(part)))
    return np.concatenate(counts)
