"""A pole's axis and radius, from the delays, azimuths and losses of its paths together.

Paths end on the surface, on the side of their antennas: the bounces of antennas around a column lie up to its thickness
apart. What a path loses tells the radius, for the wave spreads behind a convex face the more the thinner that is; the
delays of paths from several sides tell it again.
"""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.loss import weighted_quantile
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.model.ragged import first_of_each
from erm.reconstruction.poles.point_scatterers import ALIKE, THICKEST, THINNEST, radii_of
from erm.reconstruction.search.images import GATE

ROUND = 0.01  # m; what masts depart from cylinders by: they taper, and have doors and edges
IMPERFECT = 0.1  # m; what a radius may be more than the losses tell: a pole of concrete seems four fifths thinner
ROUNDS = 8  # of gathering and fitting
STEPS = 20  # of a fit, at most
LONGEST = 1.0  # m; longer steps leave what the slopes hold for
SETTLED = 1e-6  # m; shorter ones move a pole by less than it is round


class Cylinder(NamedTuple):
    """A vertical cylinder fitted to paths."""

    centre: FloatArray  # (2,) m
    radius: float  # m
    covariance: FloatArray  # (3, 3) m2, of east, north and radius
    misfits: FloatArray  # (member,) chi-squared of the paths, the cylinder taken as exact
    by_loss: float  # m; radius of a perfectly reflecting one that loses as much
    by_loss_std: float  # m
    radii: FloatArray  # (member,) m, the same of each path
    top: float  # m, of the highest bounce

    @property
    def pull(self) -> float:
        """Chi-squared of the radius that the losses tell."""
        return ((self.radius - self.by_loss) / self.by_loss_std) ** 2

    @property
    def strain(self) -> float:
        """Chi-squared a degree of freedom."""
        return (float(self.misfits.sum()) + self.pull) / (2 * len(self.misfits) - 2)


class Seen(NamedTuple):
    """How paths depart from those off a cylinder."""

    length: FloatArray  # (path,) m, measured minus predicted
    azimuth: FloatArray  # (path,) degree, measured minus predicted
    by_length: FloatArray  # (path, 3) slopes of the predicted length by east, north and radius
    by_azimuth: FloatArray  # (path, 3) degree a metre
    bounce: FloatArray  # (path, 2) m


def seen(paths: Paths, centre: FloatArray, radius: float) -> Seen:
    """Compare paths with those off a cylinder.

    The bounce lies a radius from the axis in the middle between the directions to the antennas, but for terms of
    ``radius**2`` over their distance. A path by way of a surface is the shortest there is, so that its length follows
    the axis as if the bounce moved along, ``-(u_tx + u_rx)`` a metre, and ``-2 cos(theta)`` a metre of radius.
    """
    tx, rx = paths.tx[:, :2], paths.rx[:, :2]
    outward = _unit(_unit(tx - centre) + _unit(rx - centre))
    bounce = centre + radius * outward
    first, second = tx - bounce, rx - bounce
    level = np.linalg.norm(first, axis=-1) + np.linalg.norm(second, axis=-1)
    slant = np.hypot(level, paths.tx[:, 2] - paths.rx[:, 2])
    moved = -(_unit(first) + _unit(second)) * (level / slant)[:, None]
    turned = np.rad2deg(np.stack([second[:, 1], -second[:, 0]], axis=-1) / np.sum(second**2, axis=-1)[:, None])
    azimuth = np.rad2deg(np.arctan2(-second[:, 1], -second[:, 0]))
    return Seen(
        paths.length - slant,
        angle_difference(paths.azimuth, azimuth),
        np.column_stack([moved, np.sum(moved * outward, axis=-1)]),
        np.column_stack([turned, np.sum(turned * outward, axis=-1)]),
        bounce,
    )


def fit(paths: Paths, centre: FloatArray, radius: float) -> Cylinder:
    """Weighted least squares of axis and radius, the one that the losses tell being one more measurement.

    The radius of a thin pole may come out below nought within its error; held at nought it would push the axis aside.
    """
    for _ in range(STEPS):
        now = seen(paths, centre, radius)
        by_loss, std = _radius_by_loss(paths, radii_of(paths, now.bounce)[0])
        slopes = np.vstack([now.by_length, now.by_azimuth, [0.0, 0.0, 1.0]])
        weight = np.r_[1 / _variances(paths).ravel(), std**-2]
        covariance = np.linalg.inv((slopes * weight[:, None]).T @ slopes)
        step = covariance @ (slopes.T @ (weight * np.r_[now.length, now.azimuth, by_loss - radius]))
        step *= min(1.0, LONGEST / max(float(np.abs(step).max()), SETTLED))
        centre, radius = centre + step[:2], radius + float(step[2])
        if np.abs(step).max() < SETTLED:
            break
    now = seen(paths, centre, radius)
    radii, height = radii_of(paths, now.bounce)
    misfits = np.sum(np.stack([now.length, now.azimuth]) ** 2 / _variances(paths), axis=0)
    return Cylinder(centre, radius, covariance, misfits, by_loss, std, radii, float(height.max()))


def settled(
    paths: Paths, around: IntArray, members: IntArray, centre: FloatArray, radius: float, min_support: int
) -> tuple[Cylinder, IntArray] | None:
    """Let a cylinder gather the paths around that agree with it, and fit it to these, until they no longer change.

    Parameters
    ----------
    around : array (path,) of int
        Rows of the paths that may be gathered.
    members : array (member,) of int
        Those that it starts from.

    Returns
    -------
    cylinder : Cylinder
    members : array (member,) of int
        Ascending, one a link. Nothing is returned where too few agree.
    """
    near = paths.take(around)
    for _ in range(ROUNDS):
        cylinder = fit(paths.take(members), centre, radius)
        centre, radius = cylinder.centre, cylinder.radius
        chi2 = _against(near, cylinder)
        inside = np.flatnonzero(chi2 < GATE)
        ranked = inside[np.lexsort((inside, chi2[inside], near.link[inside]))]
        gathered = np.sort(around[ranked[first_of_each(near.link[ranked])]])
        if len(gathered) < min_support:
            return None
        if np.array_equal(gathered, members):
            break
        members = gathered
    return fit(paths.take(members), centre, radius), members


def _radius_by_loss(paths: Paths, radii: FloatArray) -> tuple[float, float]:
    """Radius that the losses of a pole's paths tell, and its standard error [m].

    Gains beyond the fan are all wrong alike, so their errors are not averaged.
    """
    weight = 1 / (paths.loss_std**2 + ALIKE**2)
    alike = float(np.sum(weight * paths.loss_std) / np.sum(weight))
    error = np.hypot(alike, ALIKE / np.sqrt(len(radii)))  # dB
    radius = float(np.clip(10 ** (weighted_quantile(10 * np.log10(radii), weight, 0.5) / 10), THINNEST, THICKEST))
    return radius, float(np.hypot(radius * (10 ** (error / 10) - 1), IMPERFECT))


def _against(paths: Paths, cylinder: Cylinder) -> FloatArray:
    """Chi-squared (path,) of paths against a cylinder of some covariance."""
    now = seen(paths, cylinder.centre, cylinder.radius)
    slopes = np.stack([now.by_length, now.by_azimuth], axis=1)
    own = slopes @ cylinder.covariance @ slopes.swapaxes(1, 2)
    a, d = own[:, [0, 1], [0, 1]].T + _variances(paths)
    b = own[:, 0, 1]
    return (now.length**2 * d - 2 * now.length * now.azimuth * b + now.azimuth**2 * a) / (a * d - b * b)


def _variances(paths: Paths) -> FloatArray:
    """Variances (2, path) of lengths [m2] and azimuths [degree2] off a pole."""
    return np.stack([paths.length_std**2 + ROUND**2, paths.azimuth_std**2])


def _unit(vector: FloatArray) -> FloatArray:
    """Vectors (..., 2) of length 1; 0 where there is no direction."""
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-9)
