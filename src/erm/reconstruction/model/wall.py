"""One wall and the paths off it.

A wall is the line ``n.p = offset``. It predicts the length and azimuth of its path at every pair of antennas, so it is
fitted in the measured quantities themselves: the small error of the delay and the large one of the azimuth keep their
weights, and a wall seen from several transmitters is one wall.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import EXACT_LINE, chi_squared, residuals
from erm.reconstruction.model.line import Frame, Line, reflection_points
from erm.reconstruction.model.paths import IntArray, Paths


@dataclass(frozen=True, eq=False)
class Wall:
    """A line and its inliers: the paths that agree with it, at most one per link.

    Parameters
    ----------
    all_paths : Paths
    line : Line
    inliers : array (inlier,) of int
        Rows of ``all_paths``.
    """

    all_paths: Paths
    line: Line
    inliers: IntArray

    @cached_property
    def paths(self) -> Paths:
        """The inliers."""
        return self.all_paths.take(self.inliers)

    @cached_property
    def reflection_points(self) -> FloatArray:
        """Reflection points (inlier, 3) on the wall [m]."""
        return reflection_points(self.line, self.paths.tx, self.paths.rx)

    @property
    def support(self) -> int:
        """Number of antenna pairs that saw the wall."""
        return len(self.inliers)

    @cached_property
    def chi_squared(self) -> FloatArray:
        """Chi-squared (inlier,) of each path against the line, the line taken as exact."""
        return chi_squared(self.paths.columns, residuals(self.paths.columns, self.line.frame()), EXACT_LINE)

    def thinned(self, count: int) -> "Wall":
        """Return the wall with at most so many of its paths, evenly spread along it."""
        if self.support <= count:
            return self
        along = np.argsort(self.line.along(self.reflection_points), kind="stable")
        kept = along[np.linspace(0, self.support - 1, count).astype(np.int64)]
        return Wall(self.all_paths, self.line, self.inliers[np.sort(kept)])

    @property
    def reduced_chi_squared(self) -> float:
        """Chi-squared per degree of freedom; far above 1 where the standard errors are too small."""
        return float(np.sum(self.chi_squared) / max(2 * self.support - 2, 1))

    @cached_property
    def cos_incidence(self) -> FloatArray:
        """Cosine (inlier,) of the angle of incidence, in three dimensions."""
        return cos_incidence(self.paths, self.line.frame())


def cos_incidence(paths: Paths, frame: Frame) -> FloatArray:
    """Cosine (path,) of the angle of incidence of paths on a line, or each on one, in three dimensions."""
    return np.clip((frame.signed_distance(paths.tx) + frame.signed_distance(paths.rx)) / paths.length, 0, 1)
