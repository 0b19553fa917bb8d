"""False alarms: where paths are many and their errors large, some of them always share an image by chance.

The background is counted as in photometry, in a ring: the paths just outside the gate of a line tell how many would be
inside it without a wall.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import gammainc

from erm.common.odds import THOUSAND_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import CHI_SQUARED_GATE, misfits
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.images import BATCH_LINES, Images

RING_RADIUS = 3.0
"""Outer radius of the ring in which the background is counted, in radii of the gate. Chosen; not derived."""
DISTURBED_SHARE = 0.1
"""Share of inliers that other paths disturb, so that they lie anywhere in the gate. Chosen; not derived."""
JEFFREYS_COUNT = 0.5
"""Count added to a background, so that its rate is positive where none was counted (Jeffreys prior)."""
SURE_SUPPORT = 40
"""Links that never share an image by chance. Chosen; not derived."""


def log_odds_against_false_alarm(walls: Sequence[Wall], some: Sequence[bool]) -> FloatArray:
    """Log odds (wall,) of some candidates to be one image and no false alarm; infinite for the others.

    With ``n`` paths in the ring from 1 to `RING_RADIUS` radii of the gate, the gate holds
    ``m = (n + 1/2) / (RING_RADIUS**2 - 1)`` by chance. Of ``N`` searches, one from each path,
    ``N P(Poisson(m) >= support - 2)`` then find a group as large: a line has two parameters and
    fits any two paths. Chance also spreads its inliers evenly
    over the gate, while the chi-squared of true inliers has 2 degrees of freedom: each inlier adds the logarithm of
    ``(1 - DISTURBED_SHARE) gate / 2 exp(-chi2 / 2) + DISTURBED_SHARE``. Inliers of larger candidates are explained and
    do not count as background.
    """
    return _log_odds(walls, np.flatnonzero(some))[0]


def are_false_alarms(walls: Sequence[Wall]) -> BoolArray:
    """Candidates (wall,) that are a thousand times more likely to be false alarms than images.

    Where clutter is so dense that every image has others beside it, groups of three or four outnumber walls.
    """
    log_odds, expected = _log_odds(walls, np.flatnonzero([wall.support < SURE_SUPPORT for wall in walls]))
    return (log_odds < -THOUSAND_TO_ONE) & (expected > 1)


def _log_odds(walls: Sequence[Wall], some: IntArray) -> tuple[FloatArray, FloatArray]:
    """Log odds (wall,) of some of the candidates, and the expected number (wall,) of false alarms as large."""
    log_odds, expected = np.full(len(walls), np.inf), np.zeros(len(walls))
    if not len(some):
        return log_odds, expected
    support = np.array([wall.support for wall in walls], dtype=np.int64)
    paths = walls[0].all_paths
    by_chance = (_count_in_ring(Images(paths), walls, some) + JEFFREYS_COUNT) / (RING_RADIUS**2 - 1)
    # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
    expected[some] = len(paths) * gammainc(np.maximum(support[some] - 2, 1), by_chance)
    density = [(1 - DISTURBED_SHARE) * CHI_SQUARED_GATE / 2 * np.exp(-walls[i].chi_squared / 2) for i in some.tolist()]
    fit = [np.log(own + DISTURBED_SHARE).sum() for own in density]
    log_odds[some] = np.array(fit) - np.log(np.maximum(expected[some], 1.0))
    return log_odds, expected


def _count_in_ring(images: Images, walls: Sequence[Wall], some: IntArray) -> IntArray:
    """Number of paths in the ring about each of some walls that no larger wall explains."""
    paths = images.paths
    support = np.array([wall.support for wall in walls], dtype=np.int64)
    size, owner = np.zeros(len(paths), dtype=np.int64), np.full(len(paths), -1)
    for number, wall in enumerate(walls):
        larger = wall.inliers[size[wall.inliers] < wall.support]
        size[larger], owner[larger] = wall.support, number
    images = images.restricted_to_free(size <= support[some].max())
    counts = []
    for first in range(0, len(some), BATCH_LINES):
        part = some[first : first + BATCH_LINES]
        lines = Lines.from_list([walls[i].line for i in part.tolist()])
        of, rows = images.near_lines(lines, RING_RADIUS)
        background = np.flatnonzero((size[rows] <= support[part[of]]) & (owner[rows] != part[of]))
        of, rows = of[background], rows[background]
        chi2 = misfits(paths.columns, rows, lines, of)
        inside = (chi2 > CHI_SQUARED_GATE) & (chi2 < RING_RADIUS**2 * CHI_SQUARED_GATE)
        counts.append(np.bincount(of[inside], minlength=len(part)))
    return np.concatenate(counts)
