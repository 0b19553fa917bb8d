"""One wall and the paths off it: what it predicts, how it is fitted, where it stands.

A wall is the line ``n.p = offset``. It predicts the length and azimuth of its path at every pair of antennas,
so a set of measured paths is fitted in the measured quantities themselves: the small error of the delay and
the large one of the azimuth keep their weights, and a wall seen from several transmitters is one wall.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry import (
    FloatArray,
    angle_difference,
    face_line,
    line_covariance,
    mirrored,
    unit,
    virtual_anchor,
)

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
STEPS = 30  # of a fit, at most; five are the rule
HUBER = 2.0  # standard errors; residuals beyond pull with constant force (99 % efficient on Gaussian errors)


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
    transmitter : array (path,) of int
        Number of the place where the transmitter stood.
    loss, loss_std : array (path,)
        Reflection loss and its standard error [dB].
    wavelength : array (path,)
        [m].
    rise, rise_std : array (path,)
        Elevation less that of a path off vertical faces, and its standard error [degree]; NaN if not known.
    row : array (path,) of int
        Row of the table; hypotheses on one component share it.
    """

    tx: FloatArray
    rx: FloatArray
    length: FloatArray
    azimuth: FloatArray
    length_std: FloatArray
    azimuth_std: FloatArray
    link: IntArray
    transmitter: IntArray
    loss: FloatArray
    loss_std: FloatArray
    wavelength: FloatArray
    rise: FloatArray
    rise_std: FloatArray
    row: IntArray

    def __len__(self) -> int:
        return len(self.length)

    def take(self, rows: IntArray | BoolArray) -> "Paths":
        """Return the paths of an index or mask."""
        return Paths(*(value[rows] for value in vars(self).values()))

    def with_errors(self, length_std: FloatArray, azimuth_std: FloatArray) -> "Paths":
        """Return the same paths with other standard errors."""
        return replace(self, length_std=length_std, azimuth_std=azimuth_std)

    def anchors(self) -> FloatArray:
        """Mirror image (path, 2) of the transmitter that each path points to [m]."""
        return virtual_anchor(self.tx, self.rx, self.length, self.azimuth)


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

    def depth(self, points: FloatArray) -> FloatArray:
        """Signed distance (...) of points (..., 2 or more) in front of the line [m]."""
        return (points[..., :2] - self.pivot) @ unit(self.normal) - self.offset

    def direction(self) -> FloatArray:
        """Unit vector along the line, left of its normal."""
        return unit(self.normal + 90)

    def foot(self) -> FloatArray:
        """Point of the line nearest to the pivot [m]."""
        return self.pivot + self.offset * unit(self.normal)

    def along(self, points: FloatArray) -> FloatArray:
        """Coordinate (...) of points (..., 2 or more) along the line, left of its normal [m]."""
        return (points[..., :2] - self.pivot) @ unit(self.normal + 90)


def anchors(line: Line, tx: FloatArray) -> FloatArray:
    """Mirror images (path, 2) of the transmitters in a wall [m]."""
    return mirrored(tx[..., :2] - line.pivot, line.normal, line.offset) + line.pivot


def bounce_points(line: Line, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """Where (path, 3) the wall reflects the path of each pair of antennas [m].

    It depends on the antennas and the wall alone, so it is better by far than a point from one azimuth.
    """
    depth_tx, depth_rx = line.depth(tx), line.depth(rx)
    share = depth_rx / (depth_tx + depth_rx)
    image = np.column_stack([anchors(line, tx), tx[:, 2]])
    return rx + share[:, None] * (image - rx)


def cosine_of_incidence(paths: Paths, line: Line) -> FloatArray:
    """Cosine (path,) of the angle at which paths meet a wall, in three dimensions."""
    return np.clip((line.depth(paths.tx) + line.depth(paths.rx)) / paths.length, 0, 1)


def misfit(paths: Paths, line: Line) -> FloatArray:
    """Chi-squared (path,) of each path against a wall, the wall's own uncertainty included.

    Infinite where an antenna stands behind the wall.
    """
    residual, jacobian = residuals(paths, line)
    in_front = np.minimum(line.depth(paths.tx), line.depth(paths.rx)) > 0
    return np.where(in_front, chi_squared(paths, residual, jacobian, line.covariance), np.inf)


def chi_squared(paths: Paths, residual: FloatArray, jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """``r' (S + J C J')**-1 r`` of residuals (path, 2) in length and azimuth.

    ``S`` is the paths' own variance, ``J`` (path, 2, parameter) the predictions' slopes and ``C`` the
    covariance of the parameters.
    """
    spread = jacobian @ covariance @ jacobian.swapaxes(1, 2)
    length = spread[:, 0, 0] + paths.length_std**2
    azimuth = spread[:, 1, 1] + paths.azimuth_std**2
    mixed = spread[:, 0, 1]
    r, s = residual[:, 0], residual[:, 1]
    return (r * r * azimuth - 2 * r * s * mixed + s * s * length) / (length * azimuth - mixed**2)


def seed_line(path: Paths) -> Line:
    """Line of the face of one path, about the middle between its antennas."""
    pivot = (path.tx[0, :2] + path.rx[0, :2]) / 2
    tx, rx = path.tx.copy(), path.rx.copy()
    tx[:, :2] -= pivot
    rx[:, :2] -= pivot
    normal, offset = face_line(tx, rx, path.length, path.azimuth)
    covariance = line_covariance(tx, rx, path.length, path.azimuth, path.length_std, path.azimuth_std)
    return Line(float(normal[0]), float(offset[0]), covariance[0], pivot)


def fit_line(paths: Paths, start: Line, steps: int = STEPS) -> Line:
    """Most likely wall of a set of paths, by reweighted Gauss-Newton steps from a nearby start.

    Minimises the sum over paths of ``h((L - L(wall)) / s_L) + h((a - a(wall)) / s_a)`` with Huber's ``h``:
    squares up to `HUBER` standard errors and straight lines beyond, so that a path from elsewhere, or one whose
    delay another path pulled aside, does not bend the wall. The covariance is the inverse of the weighted normal
    matrix, that is, it takes the standard errors at their word.
    """
    points = bounce_points(start, paths.tx, paths.rx)[:, :2]
    line = start.about(points.mean(axis=0))
    scale = np.stack([1 / paths.length_std, 1 / paths.azimuth_std], axis=-1)
    for _ in range(steps):
        residual, jacobian = residuals(paths, line)
        white = (residual * scale).ravel()
        weight = np.minimum(1.0, HUBER / np.maximum(np.abs(white), HUBER))
        design = (jacobian * scale[..., None]).reshape(-1, 2)
        weighted = design * weight[:, None]
        (a, b), (_, d) = weighted.T @ design
        covariance = np.array([[d, -b], [-b, a]]) / (a * d - b * b)
        step = covariance @ (weighted.T @ white)
        line = Line(float(line.normal + step[0]) % 360, float(line.offset + step[1]), covariance, line.pivot)
        if np.abs(step).max() < 1e-11:
            break
    return line


def residuals(paths: Paths, line: Line) -> tuple[FloatArray, FloatArray]:
    """Measured minus predicted (length, azimuth) and the predictions' slopes by (normal, offset).

    The image ``VA = tx + 2 (o - n.tx) n`` moves by ``2 (o - n.tx) m - 2 (m.tx) n`` a radian, ``2 n`` a metre.
    """
    nx, ny = unit(line.normal).tolist()  # m is (-ny, nx)
    tx, rx = paths.tx[:, :2] - line.pivot, paths.rx[:, :2] - line.pivot
    depth = line.offset - tx[:, 0] * nx - tx[:, 1] * ny
    aside = tx[:, 1] * nx - tx[:, 0] * ny
    east = tx[:, 0] - rx[:, 0] + 2 * depth * nx
    north = tx[:, 1] - rx[:, 1] + 2 * depth * ny
    level = np.hypot(east, north)
    slant = np.hypot(level, paths.tx[:, 2] - paths.rx[:, 2])
    cosine, sine = east / level, north / level
    residual = np.empty((len(paths), 2))
    residual[:, 0] = paths.length - slant
    residual[:, 1] = angle_difference(paths.azimuth, np.rad2deg(np.arctan2(north, east)))
    toward_n, toward_m = cosine * nx + sine * ny, sine * nx - cosine * ny
    # the left of the line of sight is (-sine, cosine): along n and m it is -toward_m and toward_n
    jacobian = np.empty((len(paths), 2, 2))
    jacobian[:, 0, 0] = np.deg2rad(2) * (depth * toward_m - aside * toward_n) * level / slant
    jacobian[:, 1, 0] = 2 * (depth * toward_n + aside * toward_m) / level
    jacobian[:, 0, 1] = 2 * toward_n * level / slant
    jacobian[:, 1, 1] = np.rad2deg(-2 * toward_m / level)
    return residual, jacobian


@dataclass(frozen=True, eq=False)
class Wall:
    """A line, its member paths and where they bounced."""

    all_paths: Paths
    line: Line
    members: IntArray

    @cached_property
    def paths(self) -> Paths:
        """Member paths."""
        return self.all_paths.take(self.members)

    @cached_property
    def points(self) -> FloatArray:
        """Reflection points (member, 3) on the wall [m]."""
        return bounce_points(self.line, self.paths.tx, self.paths.rx)

    @property
    def support(self) -> int:
        """Number of antenna pairs that saw the wall."""
        return len(self.members)

    @cached_property
    def misfits(self) -> FloatArray:
        """Chi-squared (member,) of each path, the line taken as exact."""
        residual, jacobian = residuals(self.paths, self.line)
        return chi_squared(self.paths, residual, jacobian, np.zeros((2, 2)))

    @property
    def strain(self) -> float:
        """Chi-squared a degree of freedom; far above 1 where the standard errors were too small."""
        return float(np.sum(self.misfits) / max(2 * self.support - 2, 1))

    @property
    def rise(self) -> tuple[float, float]:
        """Weighted mean of what the elevations exceed those of vertical faces by, and its error [degree]."""
        seen = np.isfinite(self.paths.rise)
        if not seen.any():
            return 0.0, np.inf
        weight = 1 / self.paths.rise_std[seen] ** 2
        return float(np.sum(weight * self.paths.rise[seen]) / weight.sum()), float(weight.sum() ** -0.5)

    @property
    def incidence(self) -> FloatArray:
        """Cosine (member,) of the angle of incidence, in three dimensions."""
        return cosine_of_incidence(self.paths, self.line)
