"""Evidence for poles: how likely it is that paths meet in a point by chance or for another reason.

Clutter, paths of no known reflector, meets anywhere by chance: the more so, the denser it is and the larger its errors.
And receivers in a row, seen from a pole, also point to one image, that of some chain of reflections.
"""

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import gammainc

from erm.geometry.vertical import FloatArray
from erm.geometry.vertical_covariance import point_covariance
from erm.reconstruction.model.clutter import JEFFREYS_COUNT
from erm.reconstruction.model.fit import CHI_SQUARED_GATE, EXACT_LINE, chi_squared, residuals
from erm.reconstruction.model.loss import CLUTTER_LOSS_RANGE
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.poles.cylinder import ROUNDNESS, Cylinder
from erm.reconstruction.poles.point_scatterers import POLE_LOSS_SCATTER
from erm.reconstruction.search.consensus import find_groups

PRIOR_DENSITY = 1e-3
"""Prior density of poles, and of images that no wall explains [1/m2]: one in a square of 30 m. Chosen; not derived."""
COUNT_RADII = 2.0 ** np.arange(-1, 6)
"""Radii about a point within which clutter is counted [m]. Chosen; not derived."""
EMPTY_RADIUS = 2.0
"""Radius of the area in which half a path (Jeffreys prior) is assumed if none was counted [m]. Chosen; not derived."""
DENSITY_SAMPLES = 1000
"""Points at which the typical density of clutter is counted. Chosen; not derived."""


class ClutterDensity:
    """How dense clutter is.

    Parameters
    ----------
    paths : Paths
        All paths that belong to no wall.
    points : array (path, 2)
        Reflection point of each, if it was reflected once [m].
    """

    def __init__(self, paths: Paths, points: FloatArray) -> None:
        self.tree = cKDTree(points)
        self.points = points
        self.links = max(len(np.unique(paths.link)), 1)
        sample = points[:: max(len(points) // DENSITY_SAMPLES, 1)]
        counts = self.tree.query_ball_point(sample, COUNT_RADII[-1], return_length=True)
        self.typical = float(np.median(counts) if len(counts) else 0.0) / (np.pi * COUNT_RADII[-1] ** 2)  # 1/m2

    def expected_false_alarms(self, paths: Paths) -> float:
        """Number of points on which as many links would agree as on these paths if all paths were clutter.

        The gate of a path has the area ``pi gate sqrt|C|`` and holds ``m`` other paths at the typical density. Of the
        ``N`` paths, ``N P(Poisson(m) >= links - 1)`` have as much company.
        """
        in_gate = np.pi * CHI_SQUARED_GATE * float(np.mean(_areas(paths))) * self.typical
        # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
        return float(len(self.points) * gammainc(max(len(paths) - 1, 1), in_gate))

    def at(self, places: FloatArray, inliers: list[IntArray]) -> FloatArray:
        """Density (place,) of clutter of a link about places (place, 2), their own inliers left out [1/m2].

        Paths are counted within several radii and divided by the areas; the largest density is returned. Clutter from
        a few metres of a rough facade is denser than elsewhere.
        """
        counts = np.stack(
            [self.tree.query_ball_point(places, radius, return_length=True) for radius in COUNT_RADII], axis=-1
        )
        for own, count, place in zip(inliers, counts, places, strict=True):
            distance = np.linalg.norm(self.points[own] - place, axis=-1)
            count -= np.count_nonzero(distance[:, None] <= COUNT_RADII, axis=0)
        largest = (counts / (np.pi * COUNT_RADII**2)).max(axis=-1)
        return np.asarray(np.maximum(largest, JEFFREYS_COUNT / (np.pi * EMPTY_RADIUS**2)) / self.links)


def log_odds_against_clutter(paths: Paths, density: float) -> FloatArray:
    """Log odds (path,) of paths to be off a point that they agree with exactly, and not clutter.

    A measurement with the covariance ``C`` has the density ``1 / (2 pi sqrt|C|)`` at the point that it belongs to, and
    the density of clutter otherwise. ``C`` is the covariance of the reflection point; the Jacobian from delay and
    azimuth is the same for both densities.
    """
    return np.asarray(-np.log(2 * np.pi * _areas(paths) * density))


def _areas(paths: Paths) -> FloatArray:
    """``sqrt|C|`` (path,) of the covariances of reflection points [m2]."""
    length_std = np.hypot(paths.length_std, ROUNDNESS)
    covariance = point_covariance(paths.tx, paths.rx, paths.length, paths.azimuth, length_std, paths.azimuth_std)
    return np.asarray(np.sqrt(np.linalg.det(covariance[:, :2, :2])))


def pole_log_odds(paths: Paths, cylinder: Cylinder, density: float, min_support: int) -> tuple[float, float]:
    """Log odds of a pole's paths against clutter: to be off the pole, and to be off images.

    The likelihood of an explanation is the integral of that of the measurements over the position of the pole, or of
    the image: by Laplace's method ``2 pi sqrt|C| exp(-chi2 / 2)`` with the fitted covariance ``C``, times
    `PRIOR_DENSITY`. The radius is integrated over the distribution that the losses imply. Losses are compared likewise:
    those of a pole imply one radius, those off a wall are about equal, within `POLE_LOSS_SCATTER`, and those of clutter
    are anywhere in `CLUTTER_LOSS_RANGE`. An image that explains some of the paths leaves the others to clutter.

    Parameters
    ----------
    paths : Paths
        Inliers of the pole.
    cylinder : Cylinder
    density : float
        Of clutter, from `ClutterDensity` [1/m2].
    min_support : int
        Fewest paths of an image.

    Returns
    -------
    of_pole, of_images : float
        The latter is 0 where the former is negative.
    """
    single = log_odds_against_clutter(paths, density)
    volume = (2 * np.pi) * np.sqrt(np.linalg.det(cylinder.covariance)) / cylinder.radius_by_loss_std
    of_pole = np.log(PRIOR_DENSITY * volume) + single.sum()
    of_pole -= (cylinder.chi_squared.sum() + cylinder.radius_chi_squared) / 2
    of_pole += _log_odds_of_losses(10 * np.log10(cylinder.radii), paths.loss_std)
    of_images = 0.0
    if of_pole < 0:
        return float(of_pole), of_images
    for group in find_groups(paths, min_support, least_evidence=-np.inf):
        own, line = paths.take(group.inliers), group.line
        # the image moves by 2 distance along the wall per radian, and by 2 towards it per metre
        distance = abs(float(line.signed_distance(own.tx[0])))
        area = 4 * np.deg2rad(distance) * np.sqrt(np.linalg.det(line.covariance))
        chi2 = chi_squared(own.columns, residuals(own.columns, line.frame()), EXACT_LINE)
        of_image = np.log(PRIOR_DENSITY * 2 * np.pi * area) + single[group.inliers].sum() - chi2.sum() / 2
        of_images += max(of_image + _log_odds_of_losses(own.loss, own.loss_std), 0.0)
    return float(of_pole), float(of_images)


def _log_odds_of_losses(level: FloatArray, std: FloatArray) -> float:
    """Log odds of levels [dB] to be equal within errors and `POLE_LOSS_SCATTER`, and not anywhere."""
    variance = std**2 + POLE_LOSS_SCATTER**2
    mean = np.sum(level / variance) / np.sum(1 / variance)
    chi2 = np.sum((level - mean) ** 2 / variance)
    volume = np.log(2 * np.pi / np.sum(1 / variance)) / 2 - np.log(CLUTTER_LOSS_RANGE)
    return float(volume + np.sum(np.log(CLUTTER_LOSS_RANGE) - np.log(2 * np.pi * variance) / 2) - chi2 / 2)
