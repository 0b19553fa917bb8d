"""Lines of walls, seen from above: one with its covariance, or many in arrays."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, face_line, mirrored, unit
from erm.geometry.vertical_covariance import line_covariance
from erm.reconstruction.model.paths import BoolArray, IntArray, PathColumns, Paths

PLANE_SPAN = 100.0
"""Range of the offsets of planes before any measurement [m]. Chosen; not derived."""


class Frame(NamedTuple):
    """Coordinates of a line ``n.(p - pivot) = offset``, ``n`` a unit vector; numbers, or one line per path (path,)."""

    nx: FloatArray | float
    ny: FloatArray | float
    offset: FloatArray | float  # m
    px: FloatArray | float  # m
    py: FloatArray | float  # m

    def signed_distance(self, points: FloatArray) -> FloatArray:
        """Distance (...) of points (..., 2 or more) from the line, positive in front of it [m]."""
        return self.signed_distance_at(points[..., 0], points[..., 1])

    def signed_distance_at(self, east: FloatArray, north: FloatArray) -> FloatArray:
        """Distance (...) of points in columns (...) from the line, positive in front of it [m]."""
        return (east - self.px) * self.nx + (north - self.py) * self.ny - self.offset

    def along(self, points: FloatArray) -> FloatArray:
        """Coordinate (...) of points (..., 2 or more) along the line, to the left of its normal [m]."""
        return self.along_at(points[..., 0], points[..., 1])

    def along_at(self, east: FloatArray, north: FloatArray) -> FloatArray:
        """Coordinate (...) of points in columns (...) along the line, to the left of its normal [m]."""
        return (north - self.py) * self.nx - (east - self.px) * self.ny

    def reflection_points(self, paths: PathColumns) -> tuple[FloatArray, FloatArray]:
        """Reflection points of paths (path,), east and north [m].

        They depend on the antennas and the line only. This is far more accurate than a point from one azimuth.
        """
        near = self.signed_distance_at(paths.rx_east, paths.rx_north)
        far = self.signed_distance_at(paths.tx_east, paths.tx_north)
        share = near / (far + near)
        east = paths.rx_east + share * (paths.tx_east - 2 * far * self.nx - paths.rx_east)
        north = paths.rx_north + share * (paths.tx_north - 2 * far * self.ny - paths.rx_north)
        return east, north


class Line(NamedTuple):
    """Line of a wall, with the covariance of (normal, offset from ``pivot``).

    With a pivot in the middle of the reflection points, direction and offset are almost uncorrelated, and a
    campaign far from the origin loses no digits.
    """

    normal: float  # degree
    offset: float  # m, n.(p - pivot)
    covariance: FloatArray  # (2, 2) of (degree, m)
    pivot: FloatArray  # (2,) m

    def frame(self) -> Frame:
        """Return the coordinates of the line."""
        nx, ny = unit(self.normal).tolist()
        px, py = self.pivot.tolist()
        return Frame(nx, ny, self.offset, px, py)

    def with_pivot(self, pivot: FloatArray) -> "Line":
        """Return the same line with its offset measured from another point (2,)."""
        return Lines.from_list([self]).with_pivot(pivot[None]).line(0)

    def signed_distance(self, points: FloatArray) -> FloatArray:
        """Distance (...) of points (..., 2 or more) from the line, positive in front of it [m]."""
        return self.frame().signed_distance(points)

    def direction(self) -> FloatArray:
        """Unit vector (2,) along the line, to the left of its normal."""
        return unit(self.normal + 90)

    def foot(self) -> FloatArray:
        """Point (2,) of the line that is nearest to the pivot [m]."""
        return self.pivot + self.offset * unit(self.normal)

    def along(self, points: FloatArray) -> FloatArray:
        """Coordinate (...) of points (..., 2 or more) along the line, to the left of its normal [m]."""
        return self.frame().along(points)


class Lines(NamedTuple):
    """Many lines."""

    normal: FloatArray  # (line,) degree
    offset: FloatArray  # (line,) m
    covariance: FloatArray  # (line, 2, 2)
    pivot: FloatArray  # (line, 2) m

    @classmethod
    def from_list(cls, lines: list[Line]) -> "Lines":
        """Return lines in arrays."""
        return cls(
            np.array([line.normal for line in lines], dtype=float),
            np.array([line.offset for line in lines], dtype=float),
            np.array([line.covariance for line in lines], dtype=float).reshape(-1, 2, 2),
            np.array([line.pivot for line in lines], dtype=float).reshape(-1, 2),
        )

    def line(self, number: int) -> Line:
        """Return one of them."""
        normal, offset, covariance, pivot = self
        return Line(float(normal[number]), float(offset[number]), covariance[number], pivot[number])

    def take(self, lines: IntArray | BoolArray | slice) -> "Lines":
        """Return the lines of an index or mask."""
        return Lines(*(value[lines] for value in self))

    def with_replaced(self, lines: IntArray | BoolArray, others: "Lines") -> "Lines":
        """Return these lines, those of an index or mask replaced by others."""
        return Lines(*(_replaced(mine, lines, theirs) for mine, theirs in zip(self, others, strict=True)))

    def frames(self, of: IntArray | None = None) -> Frame:
        """Return the coordinates of the line (path,) of each path, or of each line."""
        n = unit(self.normal)
        columns = (n[:, 0], n[:, 1], self.offset, self.pivot[:, 0], self.pivot[:, 1])
        return Frame(*(columns if of is None else (column[of] for column in columns)))

    def with_pivot(self, pivot: FloatArray) -> "Lines":
        """Return the same lines with their offsets measured from other points (line, 2)."""
        n = unit(self.normal)
        shift = pivot - self.pivot
        slope = np.deg2rad(shift[:, 0] * n[:, 1] - shift[:, 1] * n[:, 0])
        a, b, d = self.covariance[:, 0, 0], self.covariance[:, 0, 1], self.covariance[:, 1, 1]
        covariance = np.empty((len(n), 2, 2))
        covariance[:, 0, 0] = a
        covariance[:, 0, 1] = covariance[:, 1, 0] = b + slope * a
        covariance[:, 1, 1] = d + 2 * slope * b + slope**2 * a
        return Lines(self.normal, self.offset - np.sum(n * shift, axis=-1), covariance, pivot)


def mirror_images(line: Line, tx: FloatArray) -> FloatArray:
    """Mirror images (..., 2) of transmitters (..., 2 or more) in a wall [m]."""
    return mirrored(tx[..., :2] - line.pivot, line.normal, line.offset) + line.pivot


def reflection_points(line: Line, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """Points (path, 3) where a wall reflects the path of each pair of antennas (path, 3) [m]."""
    frame = line.frame()
    near, far = frame.signed_distance(rx), frame.signed_distance(tx)
    image = np.stack([tx[:, 0] - 2 * far * frame.nx, tx[:, 1] - 2 * far * frame.ny, tx[:, 2]], axis=-1)
    return rx + (near / (far + near))[:, None] * (image - rx)


def seed_lines(paths: Paths) -> Lines:
    """Line of the face of each path alone, with the pivot in the middle between its antennas."""
    pivot = (paths.tx[:, :2] + paths.rx[:, :2]) / 2
    tx, rx = paths.tx.copy(), paths.rx.copy()
    tx[:, :2] -= pivot
    rx[:, :2] -= pivot
    normal, offset = face_line(tx, rx, paths.length, paths.azimuth)
    covariance = line_covariance(tx, rx, paths.length, paths.azimuth, paths.length_std, paths.azimuth_std)
    return Lines(normal, offset, covariance, pivot)


def seed_line(paths: Paths) -> Line:
    """Line of the face of the first path."""
    return seed_lines(paths).line(0)


def _replaced(values: FloatArray, where: IntArray | BoolArray, by: FloatArray) -> FloatArray:
    copy = values.copy()
    copy[where] = by
    return copy
