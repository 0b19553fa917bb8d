"""One wall and the paths off it: what it predicts, and where it stands.

A wall is the line ``n.p = offset``. It predicts the length and azimuth of its path at every pair of antennas,
so a set of measured paths is fitted in the measured quantities themselves: the small error of the delay and
the large one of the azimuth keep their weights, and a wall seen from several transmitters is one wall.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import chi_squared, residuals
from erm.reconstruction.model.line import Line, bounce_points
from erm.reconstruction.model.paths import IntArray, Paths


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
        return chi_squared(self.paths.rays, residuals(self.paths.rays, self.line.frame()), (0.0, 0.0, 0.0))

    def thinned(self, most: int) -> "Wall":
        """Return the wall with at most so many of its paths, evenly along it: they tell where others pass as well."""
        if self.support <= most:
            return self
        along = np.argsort(self.line.along(self.points), kind="stable")
        kept = along[np.linspace(0, self.support - 1, most).astype(np.int64)]
        return Wall(self.all_paths, self.line, self.members[np.sort(kept)])

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

    @cached_property
    def incidence(self) -> FloatArray:
        """Cosine (member,) of the angle of incidence, in three dimensions."""
        return cosine_of_incidence(self.paths, self.line)


def cosine_of_incidence(paths: Paths, line: Line) -> FloatArray:
    """Cosine (path,) of the angle at which paths meet a wall, in three dimensions."""
    return np.clip((line.depth(paths.tx) + line.depth(paths.rx)) / paths.length, 0, 1)
