"""Lines of walls: one with its covariance, or many in arrays."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, face_line, line_covariance, mirrored, unit
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths, Rays


class Frame(NamedTuple):
    """A line in numbers, or one line a path in arrays (path,): ``n.(p - pivot) = offset``, ``n`` a unit vector."""

    nx: FloatArray | float
    ny: FloatArray | float
    offset: FloatArray | float  # m
    px: FloatArray | float  # m
    py: FloatArray | float  # m

    def depth(self, points: FloatArray) -> FloatArray:
        """Signed distance (...) of points (..., 2 or more) in front of the line [m]."""
        return self.before(points[..., 0], points[..., 1])

    def before(self, east: FloatArray, north: FloatArray) -> FloatArray:
        """Signed distance (...) of points in columns (...) in front of the line [m]."""
        return (east - self.px) * self.nx + (north - self.py) * self.ny - self.offset

    def along(self, points: FloatArray) -> FloatArray:
        """Coordinate (...) of points (..., 2 or more) along the line, left of its normal [m]."""
        return (points[..., 1] - self.py) * self.nx - (points[..., 0] - self.px) * self.ny

    def bounce(self, rays: Rays) -> tuple[FloatArray, FloatArray]:
        """Return where (path,), east and north, paths bounce off [m].

        It depends on the antennas and the wall alone, so it is better by far than a point from one azimuth.
        """
        near, far = self.before(rays.rx_east, rays.rx_north), self.before(rays.tx_east, rays.tx_north)
        share = near / (far + near)
        east = rays.rx_east + share * (rays.tx_east - 2 * far * self.nx - rays.rx_east)
        north = rays.rx_north + share * (rays.tx_north - 2 * far * self.ny - rays.rx_north)
        return east, north


class Line(NamedTuple):
    """A wall's line, with the covariance of (normal, offset from ``pivot``).

    About a pivot amid its reflection points a line's direction and offset are all but uncorrelated, and a
    campaign far from the origin loses no digits.
    """

    normal: float  # degree
    offset: float  # m, n.(p - pivot)
    covariance: FloatArray  # (2, 2) of (degree, m)
    pivot: FloatArray  # (2,) m

    def frame(self) -> Frame:
        """Return the line in numbers."""
        nx, ny = unit(self.normal).tolist()
        px, py = self.pivot.tolist()
        return Frame(nx, ny, self.offset, px, py)

    def about(self, pivot: FloatArray) -> "Line":
        """Return the same line with its offset counted from another point."""
        return Lines.of([self]).about(pivot[None]).one(0)

    def depth(self, points: FloatArray) -> FloatArray:
        """Signed distance (...) of points (..., 2 or more) in front of the line [m]."""
        return self.frame().depth(points)

    def direction(self) -> FloatArray:
        """Unit vector along the line, left of its normal."""
        return unit(self.normal + 90)

    def foot(self) -> FloatArray:
        """Point of the line nearest to the pivot [m]."""
        return self.pivot + self.offset * unit(self.normal)

    def along(self, points: FloatArray) -> FloatArray:
        """Coordinate (...) of points (..., 2 or more) along the line, left of its normal [m]."""
        return self.frame().along(points)


class Lines(NamedTuple):
    """Many lines."""

    normal: FloatArray  # (line,) degree
    offset: FloatArray  # (line,) m
    covariance: FloatArray  # (line, 2, 2)
    pivot: FloatArray  # (line, 2) m

    @classmethod
    def of(cls, lines: list[Line]) -> "Lines":
        """Return lines in arrays."""
        return cls(
            np.array([line.normal for line in lines], dtype=float),
            np.array([line.offset for line in lines], dtype=float),
            np.array([line.covariance for line in lines], dtype=float).reshape(-1, 2, 2),
            np.array([line.pivot for line in lines], dtype=float).reshape(-1, 2),
        )

    def one(self, number: int) -> Line:
        """Return one of them."""
        normal, offset, covariance, pivot = self
        return Line(float(normal[number]), float(offset[number]), covariance[number], pivot[number])

    def take(self, lines: IntArray | BoolArray | slice) -> "Lines":
        """Return those of an index or mask."""
        return Lines(*(value[lines] for value in self))

    def put(self, lines: IntArray | BoolArray, others: "Lines") -> "Lines":
        """Return these with those of an index or mask replaced."""
        return Lines(*(_replaced(mine, lines, theirs) for mine, theirs in zip(self, others, strict=True)))

    def frames(self, of: IntArray | None = None) -> Frame:
        """Return the line (path,) of each path, or each line as it is."""
        n = unit(self.normal)
        columns = (n[:, 0], n[:, 1], self.offset, self.pivot[:, 0], self.pivot[:, 1])
        return Frame(*(columns if of is None else (column[of] for column in columns)))

    def about(self, pivot: FloatArray) -> "Lines":
        """Return the same lines with their offsets counted from other points (line, 2)."""
        n = unit(self.normal)
        shift = pivot - self.pivot
        slope = np.deg2rad(shift[:, 0] * n[:, 1] - shift[:, 1] * n[:, 0])
        a, b, d = self.covariance[:, 0, 0], self.covariance[:, 0, 1], self.covariance[:, 1, 1]
        covariance = np.empty((len(n), 2, 2))
        covariance[:, 0, 0] = a
        covariance[:, 0, 1] = covariance[:, 1, 0] = b + slope * a
        covariance[:, 1, 1] = d + 2 * slope * b + slope**2 * a
        return Lines(self.normal, self.offset - np.sum(n * shift, axis=-1), covariance, pivot)


def anchors(line: Line, tx: FloatArray) -> FloatArray:
    """Mirror images (path, 2) of the transmitters in a wall [m]."""
    return mirrored(tx[..., :2] - line.pivot, line.normal, line.offset) + line.pivot


def bounce_points(line: Line, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """Where (path, 3) the wall reflects the path of each pair of antennas [m]."""
    frame = line.frame()
    before, behind = frame.depth(rx), frame.depth(tx)
    image = np.stack([tx[:, 0] - 2 * behind * frame.nx, tx[:, 1] - 2 * behind * frame.ny, tx[:, 2]], axis=-1)
    return rx + (before / (behind + before))[:, None] * (image - rx)


def seed_lines(path: Paths) -> Lines:
    """Line of the face of each path, about the middle between its antennas."""
    pivot = (path.tx[:, :2] + path.rx[:, :2]) / 2
    tx, rx = path.tx.copy(), path.rx.copy()
    tx[:, :2] -= pivot
    rx[:, :2] -= pivot
    normal, offset = face_line(tx, rx, path.length, path.azimuth)
    covariance = line_covariance(tx, rx, path.length, path.azimuth, path.length_std, path.azimuth_std)
    return Lines(normal, offset, covariance, pivot)


def seed_line(path: Paths) -> Line:
    """Line of the face of the first path."""
    return seed_lines(path).one(0)


def _replaced(values: FloatArray, where: IntArray | BoolArray, by: FloatArray) -> FloatArray:
    copy = values.copy()
    copy[where] = by
    return copy
