"""Point scatterers: points from which paths reach every receiver; how they are fitted, and how thick they are."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.loss import weighted_quantiles
from erm.reconstruction.model.paths import IntArray, PathColumns, Paths
from erm.reconstruction.model.ragged import Ragged, list_sums
from erm.reconstruction.search.refine_groups import best_of_each_link

POLE_DEPTH = 0.05
"""Error of length for a path that ends on the pole's surface and not in its centre [m]. Chosen; not derived."""
MIN_RADIUS, MAX_RADIUS = 0.005, 1.0
"""Radii of perfectly reflecting poles that are considered [m]: from wood as thick as an arm to a pillar."""
POLE_LOSS_SCATTER = 3.0
"""Standard deviation of the losses of one pole's paths about those of its radius [dB]. Chosen; not derived."""
MAX_REFINEMENTS = 8
"""Repetitions of collecting and fitting the paths of a pole. Chosen; not derived."""
MAX_STEPS = 10
"""Gauss-Newton steps of a fit at most. Chosen; not derived."""
STEP_TOLERANCE = 1e-9
"""Step below which a fit has converged [m]. Chosen; not derived."""


class InitialPole(NamedTuple):
    """Approximate position and radius of a pole, and its paths."""

    centre: FloatArray  # (2,) m
    radius: float  # m
    inliers: IntArray


class Points(NamedTuple):
    """Positions with their covariances."""

    position: FloatArray  # (point, 2) m
    covariance: FloatArray  # (point, 2, 2) m2

    def take(self, points: IntArray) -> "Points":
        """Return some of them."""
        return Points(self.position[points], self.covariance[points])


def refine_points(paths: Paths, starts: Points, around: Ragged, min_support: int) -> tuple[Points, Ragged, Ragged]:
    """Let points collect the paths around that agree with them, and fit them to these, until they no longer change.

    Parameters
    ----------
    paths : Paths
    starts : Points
    around : Ragged
        Paths that each point may collect.
    min_support : int

    Returns
    -------
    points : Points
    inliers : Ragged
        Paths of each, one per link, ascending; none where fewer than ``min_support`` agree.
    depends_on : Ragged
        Paths that were collected on the way: whether others are free makes no difference.
    """
    position, covariance = starts.position.copy(), starts.covariance.copy()
    count = len(position)
    active = np.arange(count)
    before = Ragged.empty(count)
    owners: list[IntArray] = []
    rows: list[IntArray] = []
    final: list[tuple[IntArray, IntArray]] = []  # owners and rows of the final inliers
    for repetition in range(MAX_REFINEMENTS):
        collected = _collect_inliers(paths, Points(position[active], covariance[active]), around.take(active))
        owners.append(active[collected.owner])
        rows.append(collected.rows)
        enough = collected.sizes >= min_support
        converged = collected.equals(before)[enough]
        active, before = active[enough], collected.take(np.flatnonzero(enough))
        if len(active) == 0:
            break
        position[active], covariance[active] = _fit_points(paths, position[active], before)
        ends = converged | (repetition == MAX_REFINEMENTS - 1)
        own = before.take(np.flatnonzero(ends))
        final.append((active[ends][own.owner], own.rows))
        active, before = active[~ends], before.take(np.flatnonzero(~ends))
        if len(active) == 0:
            break
    inliers = Ragged.from_parts([one for one, _ in final], [own for _, own in final], count)
    return Points(position, covariance), inliers, Ragged.from_parts(owners, rows, count)


def initial_poles(paths: Paths, points: Points, inliers: Ragged) -> list[InitialPole | None]:
    """Poles whose surfaces are at points; None where the losses of the paths do not imply a radius of a pole."""
    own, of = paths.take(inliers.rows), inliers.owner
    radii = radii_from_loss(own, points.position[of])[0]
    weight = 1 / (own.loss_std**2 + POLE_LOSS_SCATTER**2)
    median = weighted_quantiles(10 * np.log10(radii), weight, inliers.start, 0.5)
    # the errors of gains beyond the elevations of the scan are correlated, so they are not averaged
    error = list_sums(weight * own.loss_std, inliers.start) / list_sums(weight, inliers.start)
    smallest, largest = 10 ** ((median - error) / 10), 10 ** ((median + error) / 10)
    impossible = (largest < MIN_RADIUS) | (smallest > MAX_RADIUS)
    radius = np.clip(10 ** (median / 10), MIN_RADIUS, MAX_RADIUS)
    # a fitted point is on the surface, on the side of the antennas
    antennas = list_sums((own.tx[:, :2] + own.rx[:, :2]) / 2, inliers.start) / inliers.sizes[:, None]
    inward = points.position - antennas
    centre = points.position + radius[:, None] * inward / np.linalg.norm(inward, axis=-1, keepdims=True)
    return [None if impossible[i] else InitialPole(centre[i], float(radius[i]), rows) for i, rows in enumerate(inliers)]


def point_misfit(paths: PathColumns, position: FloatArray, covariance: FloatArray) -> FloatArray:
    """Chi-squared (path,) of paths against a point (2,) with its covariance, or each against one (path, 2)."""
    length, azimuth, by_length, by_azimuth = _residuals(paths, position)
    length_std, azimuth_std = path_errors(paths)
    a, b, d = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    (le, ln), (ae, an) = by_length, by_azimuth
    of_east, of_north = le * a + ln * b, le * b + ln * d
    length_variance = of_east * le + of_north * ln + length_std**2
    mixed = of_east * ae + of_north * an
    azimuth_variance = ae * ae * a + 2 * ae * an * b + an * an * d + azimuth_std**2
    return (length**2 * azimuth_variance - 2 * length * azimuth * mixed + azimuth**2 * length_variance) / (
        length_variance * azimuth_variance - mixed**2
    )


def path_errors(paths: PathColumns) -> tuple[FloatArray, FloatArray]:
    """Standard errors (path,) of length [m] and azimuth [degree] of a path off a pole."""
    return np.hypot(paths.length_std, POLE_DEPTH), paths.azimuth_std


def radii_from_loss(paths: Paths, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radius of a perfectly reflecting pole that loses what each path lost.

    `erm.tracing.cylinders.pole_spreading` solved for the radius ``a``: with ``q`` the ratio of power lost,
    ``a = 2 s1 s2 cos(el)**2 / (cos(theta) L (q - 1))``. A pole that does not reflect perfectly seems too thin.

    Parameters
    ----------
    paths : Paths
    position : array (2,) or (path, 2)
        Of the pole, or of each path's [m].

    Returns
    -------
    radius, height : array (path,)
        Radius, and height of the reflection point [m].
    """
    from_tx, from_rx = position - paths.tx[:, :2], position - paths.rx[:, :2]
    d1, d2 = np.hypot(*from_tx.T), np.hypot(*from_rx.T)
    height = paths.rx[:, 2] + (paths.tx[:, 2] - paths.rx[:, 2]) * d2 / (d1 + d2)
    length = np.hypot(d1 + d2, paths.tx[:, 2] - paths.rx[:, 2])
    cos_elevation = (d1 + d2) / length
    between = np.sum(from_tx * from_rx, axis=-1) / (d1 * d2)
    cosine = np.sqrt((1 + np.clip(between, -0.999, 1)) / 2) * cos_elevation
    ratio = 10 ** (paths.loss / 10)
    s1, s2 = d1 / cos_elevation, d2 / cos_elevation
    return 2 * s1 * s2 * cos_elevation**2 / (cosine * length * np.maximum(ratio - 1, 1e-9)), height


def _collect_inliers(paths: Paths, points: Points, around: Ragged) -> Ragged:
    """Paths around points that agree with them, the best of each link, ascending."""
    of, rows = around.owner, around.rows
    chi2 = point_misfit(paths.columns.take(rows), points.position[of], points.covariance[of])
    inside = np.flatnonzero(chi2 < CHI_SQUARED_GATE)
    of, rows = of[inside], rows[inside]
    best = best_of_each_link(of, paths.link[rows], rows, chi2[inside])
    return Ragged.from_pairs(of[best], rows[best], len(around))


def _fit_points(paths: Paths, position: FloatArray, inliers: Ragged) -> tuple[FloatArray, FloatArray]:
    """Weighted least-squares points (point, 2) of lists of paths, and their covariances."""
    position, covariance = position.copy(), np.empty((len(position), 2, 2))
    active = np.arange(len(position))
    for _ in range(MAX_STEPS):
        own = inliers.take(active)
        columns = paths.columns.take(own.rows)
        terms = np.zeros((5, len(own.rows)))
        length, azimuth, by_length, by_azimuth = _residuals(columns, position[active][own.owner])
        errors = path_errors(columns)
        for value, (east, north), std in zip((length, azimuth), (by_length, by_azimuth), errors, strict=True):
            weight = 1 / std**2
            terms += weight * np.stack([east * east, east * north, north * north, east * value, north * value])
        a, b, d, u, v = np.add.reduceat(terms, own.start[:-1], axis=1)
        determinant = a * d - b * b
        covariance[active] = np.stack([d, -b, -b, a], axis=-1).reshape(-1, 2, 2) / determinant[:, None, None]
        step = np.stack([d * u - b * v, a * v - b * u], axis=-1) / determinant[:, None]
        position[active] += step
        active = active[np.abs(step).max(axis=1) >= STEP_TOLERANCE]
        if len(active) == 0:
            break
    return position, covariance


def _residuals(
    paths: PathColumns, position: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Measured minus predicted length and azimuth of paths by way of a point, and the slopes (east, north) of both.

    Seen from above, the path is ``|tx - p| + |p - rx|`` long; unfolded at a vertical surface, its slope is constant.
    """
    tx_east, tx_north = position[..., 0] - paths.tx_east, position[..., 1] - paths.tx_north
    rx_east, rx_north = position[..., 0] - paths.rx_east, position[..., 1] - paths.rx_north
    d1, d2 = np.sqrt(tx_east**2 + tx_north**2), np.sqrt(rx_east**2 + rx_north**2)
    slant = np.sqrt((d1 + d2) ** 2 + paths.height_difference**2)
    east, north = rx_east / d2, rx_north / d2
    cos_elevation = (d1 + d2) / slant
    by_length = (tx_east / d1 + east) * cos_elevation, (tx_north / d1 + north) * cos_elevation
    by_azimuth = np.rad2deg(-north / d2), np.rad2deg(east / d2)
    azimuth = angle_difference(paths.azimuth, np.rad2deg(np.arctan2(rx_north, rx_east)))
    return paths.length - slant, azimuth, by_length, by_azimuth
