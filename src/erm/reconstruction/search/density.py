"""Crowds of paths from nowhere: how many must agree before it is worth asking what on.

In a table of a million paths each one from nowhere has others beside it by chance. Groups that these make would be
found, fitted and called accidents (`erm.reconstruction.search.false_alarm`) by the ten thousand; here the seeds of
such are left out.
"""

import numpy as np
from scipy.special import gammainc

from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.search.false_alarm import UNSEEN
from erm.reconstruction.search.images import GATE, REACH, Images

COMPANY = 12  # partners; a path that has as many is not from nowhere
MEMBER = np.log(GATE / 2) - 1.0  # log odds that a true member adds on average: its chi-squared of 2 is 2
MOST = 12  # partners asked for
TWENTY = 3.0  # log odds
LEAST = 0.01  # m; width of a cell, whatever the azimuths are said to be known to


def fewest_partners(images: Images, agreeing: IntArray) -> IntArray:
    """Fewest partners (path,) of a seed whose group may be more than an accident.

    Of paths without company ``n`` lie in an area ``A`` about the seed's image; the gate of the difference of two
    images, ``pi GATE sqrt(det 2 C)``, holds ``m`` of them by chance, and ``N P(Poisson(m) >= k)`` seeds have ``k``
    partners. Against that ``k + 1`` true members bring `MEMBER` each. Odds worse than twenty to one are left out.

    Parameters
    ----------
    images : Images
    agreeing : array (path,) of int
        Partners of each.
    """
    count = len(images.paths)
    if count == 0:
        return np.empty(0, dtype=np.int64)
    a, b, d = images.covariance[:, [0, 0, 1], [0, 1, 1]].T
    gate = np.pi * GATE * 2 * np.sqrt(a * d - b * b)
    chance = gate * _density(images, agreeing < COMPANY)
    fewest = np.full(count, MOST)
    for k in range(MOST - 1, 0, -1):
        # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
        odds = (k + 1) * MEMBER - np.log(np.maximum(count * gammainc(k, chance), 1.0))
        fewest[odds >= -TWENTY] = k
    return fewest


def _density(images: Images, counted: np.ndarray) -> np.ndarray:
    """Images (path,) a square metre, of some paths of the same transmitter, in the nine cells about that of each."""
    cell = max(2 * REACH * float(np.quantile(images.across, 0.75)), LEAST)
    column, row = np.floor((images.points - images.points.min(axis=0)) / cell).astype(np.int64).T + 1
    rows, columns = int(row.max()) + 2, int(column.max()) + 2
    key = (images.paths.transmitter * columns + column) * rows + row
    cells, many = np.unique(key[counted], return_counts=True)
    around = np.zeros(len(key))
    for step in (-rows, 0, rows):
        for side in (-1, 0, 1):
            place = np.minimum(np.searchsorted(cells, key + step + side), len(cells) - 1)
            around += np.where(cells[place] == key + step + side, many[place], 0) if len(cells) else 0
    return (around + UNSEEN) / (9 * cell**2)
