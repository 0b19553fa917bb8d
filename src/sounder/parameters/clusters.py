"""Clusters of MPCs: K-power-means and DBSCAN over the multipath component distance, and spreads within and between."""

import numpy as np
from numpy.typing import NDArray

from erm.common.optional import require_library
from sounder.options import Clustering
from sounder.parameters.angles import angular_spread, mean_angle
from sounder.parameters.delay import rms_delay_spread
from sounder.parameters.multipath_distance import features

MAX_CLUSTERS = 20
"""Most clusters that are tried: TR 38.901 has 20 at most (Table 7.5-6)."""
ROUNDS = 100
"""Most rounds of one K-power-means; it converges in some ten."""
RADIUS = 0.17
"""Largest MCD between neighbours of DBSCAN: directions 20 degree apart. On random channels the number of clusters is
then right in the mean (`benchmarks/clusters.py`)."""
LEAST_MEMBERS = 1
"""MPCs within the radius that make a core of DBSCAN; with 1, lonely MPCs are clusters, not noise."""

Real = NDArray[np.float64]
Labels = NDArray[np.intp]


def k_power_means(points: Real, power: Real, number: int | None = None) -> Labels:
    """Group MPCs so that the sum of ``power * distance^2`` to the centroids of the groups is small.

    The first centroid is the strongest MPC; each further one is the MPC that is worst represented so far. Without a
    number, 2 to :data:`MAX_CLUSTERS` are tried, and that with the largest mean silhouette is taken. Fewer than three
    MPCs are a cluster each.

    Sources: Czink et al. (2006). P. J. Rousseeuw, Silhouettes: a graphical aid to the interpretation and validation of
    cluster analysis, J. Comput. Appl. Math. 20 (1987) 53-65. The indices of Davies-Bouldin and Calinski-Harabasz, which
    Czink et al. use, favour clusters of single MPCs where there are few.

    Parameters
    ----------
    points : array (path, dimension)
        From :func:`sounder.parameters.multipath_distance.features`.
    power : array (path,)
        Linear.
    number : int, optional
        Of clusters.

    Returns
    -------
    array (path,)
        Cluster of each MPC, from 0, in order of power.

    Examples
    --------
    >>> points = np.array([[0.0], [0.1], [5.0], [5.1]])
    >>> k_power_means(points, np.array([1.0, 2.0, 4.0, 4.0]), number=2).tolist()
    [1, 1, 0, 0]
    """
    distinct = len(np.unique(points, axis=0))
    if number is not None or distinct < 3:
        return _by_power(_lloyd(points, power, min(distinct, distinct if number is None else number)), power)
    tried = [_lloyd(points, power, k) for k in range(2, min(MAX_CLUSTERS, distinct - 1) + 1)]
    return _by_power(max(tried, key=lambda labels: _silhouette(points, labels)), power)


def dbscan(points: Real, power: Real, radius: float = RADIUS, least: int = LEAST_MEMBERS) -> Labels:
    """Group MPCs that are connected by steps of at most a radius (scikit-learn's DBSCAN).

    Source: M. Ester et al., A density-based algorithm for discovering clusters, KDD 1996.

    Parameters
    ----------
    points : array (path, dimension)
        From :func:`sounder.parameters.multipath_distance.features`.
    power : array (path,)
        Linear; it orders the clusters only.
    radius : float
        ``eps``.
    least : int
        ``min_samples``.

    Returns
    -------
    array (path,)
        Cluster of each MPC, from 0, in order of power; -1: in none.

    Raises
    ------
    DataError
        scikit-learn is not installed.
    """
    cluster = require_library("sklearn.cluster", "clusters", "DBSCAN", "take k-power-means")
    if not len(points):
        return np.zeros(0, np.intp)
    return _by_power(np.asarray(cluster.DBSCAN(eps=radius, min_samples=least).fit_predict(points)), power)


def cluster_spreads(delay: Real, azimuth: Real, elevation: Real, power: Real, labels: Labels) -> dict[str, float]:
    """Spreads within clusters and between them.

    Within: the square root of the mean of the squared spreads of the clusters, weighted with their powers. Between: the
    spread of the clusters' centres (mean delay, mean angle), each with the power of its cluster. Delay spreads square
    and add: ``S^2 = S_within^2 + S_between^2``, if all MPCs are in clusters.

    Parameters
    ----------
    delay, azimuth, elevation, power : array (path,)
        [s], [degree], [degree], linear.
    labels : array (path,)
        -1: in no cluster; such paths do not count.

    Returns
    -------
    dict
        ``clusters``, their number; within (``cluster_...``) and between them (``inter_cluster_...``): ``delay_spread``
        [s], ``azimuth_spread`` and ``zenith_spread`` [degree] by TR 38.901.

    Examples
    --------
    >>> delay, none = np.array([0.0, 2e-9, 100e-9, 102e-9]), np.zeros(4)
    >>> spreads = cluster_spreads(delay, none, none, np.ones(4), np.array([0, 0, 1, 1]))
    >>> print(spreads["clusters"], f"{spreads['cluster_delay_spread']:.3g} {spreads['inter_cluster_delay_spread']:.3g}")
    2 1e-09 5e-08
    """
    members = [labels == label for label in range(labels.max(initial=-1) + 1)]
    powers = np.array([power[one].sum() for one in members])
    spreads: dict[str, float] = {"clusters": len(members)}
    times = np.array([np.average(delay[one], weights=power[one]) for one in members])
    within = np.array([rms_delay_spread(delay[one], power[one]) for one in members])
    spreads["cluster_delay_spread"] = _mean_square(within, powers)
    spreads["inter_cluster_delay_spread"] = float(rms_delay_spread(times, powers))
    for name, angle in (("azimuth", azimuth), ("zenith", elevation)):
        centres = np.array([mean_angle(angle[one], power[one]) for one in members])
        within = np.array([angular_spread(angle[one], power[one]) for one in members])
        spreads[f"cluster_{name}_spread"] = _mean_square(within, powers)
        spreads[f"inter_cluster_{name}_spread"] = float(angular_spread(centres, powers))
    return spreads


def find_clusters(
    delay: Real, azimuth: Real, elevation: Real, power: Real, method: Clustering = "k-power-means"
) -> Labels:
    """Group MPCs (path,) by their MCD; returns labels (path,) as :func:`k_power_means` and :func:`dbscan` do."""
    points = features(delay, azimuth, elevation)
    return dbscan(points, power) if method == "dbscan" else k_power_means(points, power)


def _mean_square(spread: Real, power: Real) -> float:
    return float(np.sqrt(np.average(spread**2, weights=power))) if power.size else float("nan")


def _lloyd(points: Real, power: Real, number: int) -> Labels:
    """K-means with powers as weights, from the strongest point and the worst represented ones."""
    if not number:
        return np.zeros(len(points), np.intp)
    chosen = [int(np.argmax(power))]
    nearest = _squares(points, points[chosen])[:, 0]
    while len(chosen) < number:
        chosen.append(int(np.argmax(power * nearest)))
        nearest = np.minimum(nearest, _squares(points, points[chosen[-1:]])[:, 0])
    centroids = points[chosen]
    labels = np.full(len(points), -1)
    for _ in range(ROUNDS):
        before, labels = labels, _squares(points, centroids).argmin(axis=1)
        if np.array_equal(before, labels):
            break
        for k in np.unique(labels):
            centroids[k] = np.average(points[labels == k], axis=0, weights=power[labels == k])
    return np.unique(labels, return_inverse=True)[1].astype(np.intp)


def _squares(points: Real, centroids: Real) -> Real:
    """Squared distances (point, centroid)."""
    return np.asarray(((points[:, None] - centroids) ** 2).sum(axis=-1))


def _silhouette(points: Real, labels: Labels) -> float:
    """Mean of ``(b - a) / max(a, b)``: mean distance ``a`` to the own cluster, ``b`` to the next; 0 if it is alone."""
    members = np.eye(labels.max() + 1)[labels]
    count, rows = members.sum(axis=0), np.arange(len(labels))
    total = np.sqrt(_squares(points, points)) @ members
    own = total[rows, labels] / np.maximum(count[labels] - 1, 1)
    others = total / count
    others[rows, labels] = np.inf
    following = others.min(axis=1)
    return float(np.mean(np.where(count[labels] > 1, (following - own) / np.maximum(own, following), 0)))


def _by_power(labels: Labels, power: Real) -> Labels:
    """Labels renumbered in order of the clusters' powers; -1 stays."""
    number = int(labels.max(initial=-1)) + 1
    order = np.argsort([-power[labels == k].sum() for k in range(number)], kind="stable")
    rank = np.empty(number + 1, np.intp)
    rank[order] = np.arange(number)
    rank[-1] = -1
    return rank[labels]
