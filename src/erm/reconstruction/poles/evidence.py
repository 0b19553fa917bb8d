"""Whether paths that meet in a point met a pole there: what else may have made them, and how likely that is.

Paths from nowhere meet anywhere by chance: the sooner, the more of them there are about and the wider their errors.
And receivers in a row, seen from a pole, point to one image as well: that of some chain of bounces.
"""

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import betaln, gammainc

from erm.geometry.vertical import FloatArray, point_covariance
from erm.reconstruction.model.fit import chi_squared, residuals
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.poles.cylinder import ROUND, Cylinder
from erm.reconstruction.poles.point_scatterers import ALIKE
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.false_alarm import UNSEEN
from erm.reconstruction.search.images import GATE

PER_AREA = 1e-3  # 1/m2; one pole, and one image that no wall explains, in a square of 30 m
SPAN = 30.0  # dB; the losses of paths from anywhere
SCALES = 2.0 ** np.arange(-1, 6)  # m; radii about a point within which paths are counted
ASKED = 1000  # places at which it is counted how dense paths usually are
EMPTY = 2.0  # m; where none is counted there may be half a path (Jeffreys) within this


class Strays:
    """How dense paths from nowhere are.

    Parameters
    ----------
    paths : Paths
        All that no wall has.
    points : array (path, 2)
        Where each bounced, if once [m].
    """

    def __init__(self, paths: Paths, points: FloatArray) -> None:
        self.tree = cKDTree(points)
        self.points = points
        self.links = len(np.unique(paths.link))
        some = points[:: max(len(points) // ASKED, 1)]
        about = self.tree.query_ball_point(some, SCALES[-1], return_length=True)
        self.usual = float(np.median(about)) / (np.pi * SCALES[-1] ** 2)  # 1/m2

    def accidents(self, paths: Paths) -> float:
        """Points anywhere that as many links would agree on as these, if all paths came from nowhere.

        The gate of a path has the area ``pi GATE sqrt|C|``, and holds ``m`` others where paths are as dense as usual.
        Each of the ``N`` paths lays a point, and ``N P(Poisson(m) >= links - 1)`` have as much company.
        """
        held = np.pi * GATE * float(np.mean(_sizes(paths))) * self.usual
        # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
        return float(len(self.points) * gammainc(max(len(paths) - 1, 1), held))

    def density(self, places: FloatArray, members: list[IntArray]) -> FloatArray:
        """Paths (place,) other than the members that a link lays in a square metre about places, at most [1/m2].

        What is counted within some radii is divided by their areas, and the most counts: strays come from a few metres
        of a rough facade more than from anywhere.
        """
        counted = np.stack([self.tree.query_ball_point(places, scale, return_length=True) for scale in SCALES], axis=-1)
        for own, count, place in zip(members, counted, places, strict=True):
            apart = np.linalg.norm(self.points[own] - place, axis=-1)
            count -= np.count_nonzero(apart[:, None] <= SCALES, axis=0)
        most = (counted / (np.pi * SCALES**2)).max(axis=-1)
        return np.asarray(np.maximum(most, UNSEEN / (np.pi * EMPTY**2)) / self.links)


def against_strays(paths: Paths, density: float) -> FloatArray:
    """Log odds (path,) of paths to be off a point that they hit exactly, and not from anywhere.

    A measurement of covariance ``C`` has the density ``1 / (2 pi sqrt|C|)`` at the point of which it is, and the given
    one if it is of none; ``C`` is that of the reflection point, for both are changed alike into delay and azimuth.
    """
    return np.asarray(-np.log(2 * np.pi * _sizes(paths) * density))


def _sizes(paths: Paths) -> FloatArray:
    """``sqrt|C|`` (path,) of the covariances of reflection points [m2]."""
    length_std = np.hypot(paths.length_std, ROUND)
    covariance = point_covariance(paths.tx, paths.rx, paths.length, paths.azimuth, length_std, paths.azimuth_std)
    return np.asarray(np.sqrt(np.linalg.det(covariance[:, :2, :2])))


def log_odds(paths: Paths, cylinder: Cylinder, density: float, min_support: int) -> tuple[float, float]:
    """Log odds of a pole's member paths to be off it, and to be off images, against strays.

    The likelihood of each explanation is the integral of that of the measurements over where the pole stands, or the
    image lies: by Laplace ``2 pi sqrt|C| exp(-chi2 / 2)`` with the fitted covariance ``C``, times `PER_AREA`. The
    radius is integrated over what the losses tell of it. Losses are compared likewise: those of a pole tell one
    radius, those off a wall are about equal, within `ALIKE`, and those of strays are anywhere in `SPAN`. An image that
    explains some of the paths leaves the others to the strays.

    Parameters
    ----------
    paths : Paths
        Members.
    density : float
        Of strays, from `Strays` [1/m2].
    min_support : int
        Fewest paths that an image is believed of.

    Returns
    -------
    of_pole, of_images : float
        The latter is 0 where the former is not more.
    """
    single = against_strays(paths, density)
    volume = (2 * np.pi) * np.sqrt(np.linalg.det(cylinder.covariance)) / cylinder.by_loss_std
    of_pole = np.log(PER_AREA * volume) + single.sum() - (cylinder.misfits.sum() + cylinder.pull) / 2
    of_pole += _of_losses(10 * np.log10(cylinder.radii), paths.loss_std)
    of_images = 0.0
    if of_pole < 0:
        return float(of_pole), of_images
    for group in find_groups(paths, min_support):
        own, line = paths.take(group.members), group.line
        # the image moves by 2 depth along the wall a radian, and by 2 towards it a metre
        area = 4 * np.deg2rad(abs(float(line.depth(own.tx[0])))) * np.sqrt(np.linalg.det(line.covariance))
        misfits = chi_squared(own.rays, residuals(own.rays, line.frame()), (0.0, 0.0, 0.0))
        of_image = np.log(PER_AREA * 2 * np.pi * area) + single[group.members].sum() - misfits.sum() / 2
        of_images += max(of_image + _of_losses(own.loss, own.loss_std), 0.0)
    return float(of_pole), float(of_images)


def of_choice(seeing: int, in_view: int) -> float:
    """Log probability that just these of the links in view of a place see something there.

    Few of many links find strays that agree anywhere. Any share of links to see being as likely beforehand, that ``k``
    of ``n`` do has the probability ``B(k + 1, n - k + 1)``, off a pole or an image.
    """
    return float(betaln(seeing + 1, max(in_view - seeing, 0) + 1))


def _of_losses(level: FloatArray, std: FloatArray) -> float:
    """Log odds of levels [dB] to be one within their errors and `ALIKE`, and not anywhere in `SPAN`."""
    variance = std**2 + ALIKE**2
    mean = np.sum(level / variance) / np.sum(1 / variance)
    chi2 = np.sum((level - mean) ** 2 / variance)
    volume = np.log(2 * np.pi / np.sum(1 / variance)) / 2 - np.log(SPAN)
    return float(volume + np.sum(np.log(SPAN) - np.log(2 * np.pi * variance) / 2) - chi2 / 2)
