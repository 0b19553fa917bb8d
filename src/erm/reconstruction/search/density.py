"""Density of clutter: how many partners a seed must have to be worth a search.

In a table of a million paths every clutter path, one that is no reflection off a wall, has partners by chance. Their
groups would be found, fitted and rejected as false alarms (`erm.reconstruction.search.false_alarm`) by the ten
thousand. Here such seeds are left out beforehand.
"""

import numpy as np
from scipy.special import gammainc

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.clutter import CHI_SQUARED_GATE, JEFFREYS_COUNT
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.search.images import SEARCH_RADIUS, Images

MAX_REQUIRED_PARTNERS = 12
"""Partners that are required at most; a path with as many is not counted as clutter. Chosen; not derived."""
LOG_ODDS_PER_INLIER = np.log(CHI_SQUARED_GATE / 2) - 1.0
"""Log odds that a true inlier adds on average: ``ln(gate / 2) - chi2 / 2`` with the mean ``chi2 = 2``."""
MIN_CELL = 0.01
"""Smallest width of a cell in which images are counted [m], however accurate the azimuths are said to be. Chosen; not
derived."""


def required_partners(images: Images, agreeing: IntArray) -> IntArray:
    """Fewest partners (path,) of a seed whose group may be no false alarm.

    Let ``n`` clutter paths lie in an area ``A`` about the seed's image. The gate of the difference of two images has
    the area ``pi gate sqrt(det 2 C)`` and holds ``m`` of them by chance. Of ``N`` seeds, ``N P(Poisson(m) >= k)`` then
    have ``k`` partners; ``k + 1`` true inliers add `LOG_ODDS_PER_INLIER` each. The fewest partners are returned for
    which the odds are at least 1 : 20.

    Parameters
    ----------
    images : Images
    agreeing : array (path,) of int
        Partners of each path.
    """
    count = len(images.paths)
    if count == 0:
        return np.empty(0, dtype=np.int64)
    a, b, d = images.covariance[:, [0, 0, 1], [0, 1, 1]].T
    gate = np.pi * CHI_SQUARED_GATE * 2 * np.sqrt(a * d - b * b)
    by_chance = gate * _clutter_density(images, agreeing < MAX_REQUIRED_PARTNERS)
    required = np.full(count, MAX_REQUIRED_PARTNERS)
    for k in range(MAX_REQUIRED_PARTNERS - 1, 0, -1):
        # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
        log_odds = (k + 1) * LOG_ODDS_PER_INLIER - np.log(np.maximum(count * gammainc(k, by_chance), 1.0))
        required[log_odds >= -TWENTY_TO_ONE] = k
    return required


def _clutter_density(images: Images, clutter: BoolArray) -> FloatArray:
    """Clutter images (path,) per square metre in the nine cells about the image of each path, of its transmitter."""
    cell = max(2 * SEARCH_RADIUS * float(np.quantile(images.across, 0.75)), MIN_CELL)
    column, row = np.floor((images.points - images.points.min(axis=0)) / cell).astype(np.int64).T + 1
    rows, columns = int(row.max()) + 2, int(column.max()) + 2
    key = (images.transmitter * columns + column) * rows + row
    cells, counts = np.unique(key[clutter], return_counts=True)
    around = np.zeros(len(key))
    for column_step in (-rows, 0, rows):
        for row_step in (-1, 0, 1):
            neighbour = key + column_step + row_step
            place = np.minimum(np.searchsorted(cells, neighbour), len(cells) - 1)
            around += np.where(cells[place] == neighbour, counts[place], 0) if len(cells) else 0
    return (around + JEFFREYS_COUNT) / (9 * cell**2)
