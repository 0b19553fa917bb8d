"""One wall and the paths off it: what it predicts, how it is fitted, where it stands.

A wall is the line ``n.p = offset``. It predicts the length and azimuth of its path at every pair of antennas,
so a set of measured paths is fitted in the measured quantities themselves: the small error of the delay and
the large one of the azimuth keep their weights, and a wall seen from several transmitters is one wall.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry import (
    FloatArray,
    angle_difference,
    azimuth_of,
    face_line,
    line_covariance,
    mirrored,
    unit,
)

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
MARGIN = 0.5  # m; to reflect, a face must fill about the first Fresnel zone (0.24 m, 132 GHz, 50 m legs)
DUPLICATE = 1.0  # m; faces closer than this and within the angle below are one wall's windows and ledges
DUPLICATE_ANGLE = 10.0  # degree
SOLID = 5.0  # m; between reflection points closer than this there is no passage


@dataclass(frozen=True)
class Paths:
    """Measured paths that may be single bounces, as plain arrays along ``path``.

    Parameters
    ----------
    tx, rx : array (path, 3)
        Antenna positions [m].
    length, azimuth : array (path,)
        Slant length [m] and azimuth of arrival [degree].
    length_std, azimuth_std : array (path,)
        Their standard errors.
    link : array (path,) of int
        Pair of antennas; a wall makes one path a link.
    loss : array (path,)
        Reflection loss [dB].
    """

    tx: FloatArray
    rx: FloatArray
    length: FloatArray
    azimuth: FloatArray
    length_std: FloatArray
    azimuth_std: FloatArray
    link: IntArray
    loss: FloatArray

    def __len__(self) -> int:
        return len(self.length)

    def take(self, rows: IntArray | BoolArray) -> "Paths":
        """Return the paths of an index or mask."""
        return Paths(*(value[rows] for value in vars(self).values()))


class Legs(NamedTuple):
    """Straight free stretches of paths: ``start`` and ``end`` (leg, 3) [m]."""

    start: FloatArray
    end: FloatArray


class Line(NamedTuple):
    """A wall's line, with the covariance of (normal, offset from ``pivot``).

    About a pivot amid its reflection points a line's direction and offset are all but uncorrelated, and a
    campaign far from the origin loses no digits.
    """

    normal: float  # degree
    offset: float  # m, n.(p - pivot)
    covariance: FloatArray  # (2, 2) of (degree, m)
    pivot: FloatArray  # (2,) m

    def about(self, pivot: FloatArray) -> "Line":
        """Return the same line with its offset counted from another point."""
        shift = pivot - self.pivot
        jacobian = np.array([[1.0, 0.0], [-np.deg2rad(unit(self.normal + 90) @ shift), 1.0]])
        return Line(
            self.normal,
            self.offset - float(unit(self.normal) @ shift),
            jacobian @ self.covariance @ jacobian.T,
            pivot,
        )


def anchors(line: Line, tx: FloatArray) -> FloatArray:
    """Mirror images (path, 2) of the transmitters in a wall [m]."""
    return mirrored(tx[..., :2] - line.pivot, line.normal, line.offset) + line.pivot


def bounce_points(line: Line, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """Where (path, 3) the wall reflects the path of each pair of antennas [m].

    It depends on the antennas and the wall alone, so it is better by far than a point from one azimuth.
    """
    n, origin = unit(line.normal), line.pivot
    depth_tx = (tx[:, :2] - origin) @ n - line.offset
    depth_rx = (rx[:, :2] - origin) @ n - line.offset
    share = depth_rx / (depth_tx + depth_rx)
    image = np.column_stack([anchors(line, tx), tx[:, 2]])
    return rx + share[:, None] * (image - rx)


def misfit(paths: Paths, line: Line) -> FloatArray:
    """Chi-squared (path,) of each path against a wall, the wall's own uncertainty included.

    Infinite where an antenna stands behind the wall.
    """
    residual, jacobian = _residuals(paths, line)
    n = unit(line.normal)
    in_front = np.minimum((paths.tx[:, :2] - line.pivot) @ n, (paths.rx[:, :2] - line.pivot) @ n) > line.offset
    return np.where(in_front, chi_squared(paths, residual, jacobian, line.covariance), np.inf)


def chi_squared(paths: Paths, residual: FloatArray, jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """``r' (S + J C J')**-1 r`` of residuals (path, 2) in length and azimuth.

    ``S`` is the paths' own variance, ``J`` (path, 2, parameter) the predictions' slopes and ``C`` the
    covariance of the parameters.
    """
    spread = jacobian @ covariance @ jacobian.swapaxes(1, 2)
    spread[:, 0, 0] += paths.length_std**2
    spread[:, 1, 1] += paths.azimuth_std**2
    return np.einsum("ni,ni->n", residual, np.linalg.solve(spread, residual[..., None])[..., 0])


def seed_line(path: Paths) -> Line:
    """Line of the face of one path, about its own reflection point's neighbourhood."""
    pivot = (path.tx[0, :2] + path.rx[0, :2]) / 2
    tx, rx = path.tx.copy(), path.rx.copy()
    tx[:, :2] -= pivot
    rx[:, :2] -= pivot
    normal, offset = face_line(tx, rx, path.length, path.azimuth)
    covariance = line_covariance(tx, rx, path.length, path.azimuth, path.length_std, path.azimuth_std)
    return Line(float(normal[0]), float(offset[0]), covariance[0], pivot)


def fit_line(paths: Paths, start: Line) -> Line:
    """Weighted least-squares wall of a set of paths, by Gauss-Newton from a nearby start.

    Minimises the sum over paths of ``(L - L(wall))**2 / s_L**2 + (a - a(wall))**2 / s_a**2``. The covariance
    is the inverse of the normal matrix, that is, it takes the standard errors at their word.
    """
    points = bounce_points(start, paths.tx, paths.rx)[:, :2]
    line = start.about(points.mean(axis=0))
    weight = np.stack([1 / paths.length_std, 1 / paths.azimuth_std], axis=-1)
    for _ in range(30):
        residual, jacobian = _residuals(paths, line)
        design = (jacobian * weight[..., None]).reshape(-1, 2)
        step, *_ = np.linalg.lstsq(design, (residual * weight).ravel(), rcond=None)
        covariance = np.linalg.inv(design.T @ design).astype(float)
        line = Line((line.normal + step[0]) % 360, line.offset + step[1], covariance, line.pivot)
        if np.abs(step).max() < 1e-11:
            break
    return line


def _residuals(paths: Paths, line: Line) -> tuple[FloatArray, FloatArray]:
    """Measured minus predicted (length, azimuth) and the predictions' slopes by (normal, offset).

    The image ``VA = tx + 2 (o - n.tx) n`` moves by ``2 (o - n.tx) m - 2 (m.tx) n`` a radian, ``2 n`` a metre.
    """
    n, m = unit(line.normal), unit(line.normal + 90)
    tx, rx = paths.tx[:, :2] - line.pivot, paths.rx[:, :2] - line.pivot
    depth = line.offset - tx @ n
    seen = tx + 2 * depth[:, None] * n - rx
    level = np.linalg.norm(seen, axis=-1)
    slant = np.hypot(level, paths.tx[:, 2] - paths.rx[:, 2])
    toward = seen / level[:, None]
    left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
    residual = np.stack([paths.length - slant, angle_difference(paths.azimuth, azimuth_of(seen))], axis=-1)
    by_normal = np.deg2rad(2 * (depth[:, None] * m - (tx @ m)[:, None] * n))
    by_offset = np.broadcast_to(2 * n, seen.shape)
    jacobian = np.empty((len(paths), 2, 2))
    for column, move in enumerate((by_normal, by_offset)):
        jacobian[:, 0, column] = np.sum(toward * move, axis=-1) * level / slant
        jacobian[:, 1, column] = np.rad2deg(np.sum(left * move, axis=-1) / level)
    return residual, jacobian


@dataclass(frozen=True, eq=False)
class Wall:
    """A line, its member paths and where they bounced."""

    all_paths: Paths
    line: Line
    members: IntArray

    @property
    def paths(self) -> Paths:
        """Member paths."""
        return self.all_paths.take(self.members)

    @property
    def support(self) -> int:
        """Number of antenna pairs that saw the wall."""
        return len(self.members)

    @property
    def strain(self) -> float:
        """Chi-squared a degree of freedom; far above 1 where the standard errors were too small."""
        residual, jacobian = _residuals(self.paths, self.line)
        chi2 = chi_squared(self.paths, residual, jacobian, np.zeros((2, 2)))
        return float(np.sum(chi2) / max(2 * self.support - 2, 1))

    @property
    def loss(self) -> float:
        """Median reflection loss [dB]."""
        return float(np.median(self.paths.loss))

    @property
    def points(self) -> FloatArray:
        """Reflection points (member, 3) on the wall [m]."""
        return bounce_points(self.line, self.paths.tx, self.paths.rx)

    def along(self, points: FloatArray) -> FloatArray:
        """Coordinate of points (..., 2 or more) along the wall, left of its normal [m]."""
        return (points[..., :2] - self.line.pivot) @ unit(self.line.normal + 90)

    def depth(self, points: FloatArray) -> FloatArray:
        """Signed distance of points (..., 2 or more) in front of the wall [m]."""
        return (points[..., :2] - self.line.pivot) @ unit(self.line.normal) - self.line.offset

    def stretches(self, max_gap: float, legs: Legs | None = None) -> list[IntArray]:
        """Members in runs along the wall.

        A run ends at a gap between reflection points longer than ``max_gap``, and at one through which a leg
        of another path passes below the highest of them: there is a street there, not a wall.
        """
        along = self.along(self.points)
        order = np.argsort(along, kind="stable")
        along = along[order]
        ends = np.diff(along) > max_gap
        if legs is not None:
            through, crossing = self._crossings(legs)
            open_at = self.along(crossing[through & (crossing[:, 2] < self.points[:, 2].max())])
            inside = (open_at > along[:-1, None]) & (open_at < along[1:, None])
            ends |= np.any(inside, axis=-1)
        return np.split(order, np.flatnonzero(ends) + 1)

    def is_twin(self, other: "Wall", max_gap: float) -> bool:
        """Whether the other wall is this one again, beside or barely before or behind it."""
        along, theirs = self.along(self.points), self.along(other.points)
        beside = along.min() - max_gap < np.median(theirs) < along.max() + max_gap
        turned = abs(float(angle_difference(other.line.normal, self.line.normal)))
        return bool(beside and turned < DUPLICATE_ANGLE and np.mean(np.abs(self.depth(other.points))) < DUPLICATE)

    def joined(self, other: "Wall") -> "Wall":
        """Return this wall with the other's paths from links that it has none of, fitted again."""
        fresh = other.members[~np.isin(other.paths.link, self.paths.link)]
        members = np.sort(np.r_[self.members, fresh])
        return Wall(self.all_paths, fit_line(self.all_paths.take(members), self.line), members)

    def blocks(self, legs: Legs) -> BoolArray:
        """Legs (leg,) that would have to pass through the wall where it certainly stands.

        That is between two reflection points no further apart than ``SOLID``, and not above both.
        """
        through, crossing = self._crossings(legs)
        order = np.argsort(self.along(self.points), kind="stable")
        own, height = self.along(self.points)[order], self.points[order, 2]
        above = np.searchsorted(own, self.along(crossing))
        between = (above > 0) & (above < len(own))
        a, b = np.where(between, above - 1, 0), np.where(between, above, 0)
        return through & between & (own[b] - own[a] < SOLID) & (crossing[:, 2] < np.maximum(height[a], height[b]))

    def legs(self) -> Legs:
        """Both legs of each path, antennas to reflection point."""
        points, paths = self.points, self.paths
        return Legs(np.vstack([paths.tx, paths.rx]), np.vstack([points, points]))

    def _crossings(self, legs: Legs) -> tuple[BoolArray, FloatArray]:
        """Which legs (leg,) pass from before to behind the wall's line, and where (leg, 3) [m]."""
        start, end = self.depth(legs.start), self.depth(legs.end)
        through = (np.minimum(start, end) < -MARGIN) & (np.maximum(start, end) > MARGIN)
        share = np.where(through, start, 0.0) / np.where(through, start - end, 1.0)
        return through, legs.start + share[:, None] * (legs.end - legs.start)
