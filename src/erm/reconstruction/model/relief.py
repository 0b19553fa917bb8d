r"""Relief of a facade: how its parts, piers, recessed and slightly tilted panes, scatter about the mean plane.

The offsets of the parts scatter by the relief ``s``, their directions by the tilt ``t``. A path off a part at ``delta``
from the plane, turned by ``tau``, has the density ``N(delta; 0, s**2 + s_delta**2) N(tau; 0, t**2 + s_tau**2)`` with
the errors of what it measures. By Fermat's principle the length depends on the offset at the reflection point alone,
and the azimuth on both.
"""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import residuals
from erm.reconstruction.model.line import Line
from erm.reconstruction.model.paths import BoolArray, Paths
from erm.reconstruction.model.wall import Wall

ROUNDS = 5
"""Repetitions of fitting a plane or a variance and its weights; each changes the other little. Chosen; not derived."""
MIN_SLOPE = 1e-6
"""Slope of the azimuth by a turn below which it is taken for none: the receiver is on the face [degree per degree]."""


class Relief(NamedTuple):
    """Parts of a facade about its mean plane, one for each path (path,)."""

    offset: FloatArray  # m, of the part from the plane
    turn: FloatArray  # degree
    offset_std: FloatArray  # m, errors of what was measured
    turn_std: FloatArray  # degree
    length_by_offset: FloatArray
    azimuth_by_offset: FloatArray
    azimuth_by_turn: FloatArray

    def take(self, rows: BoolArray) -> "Relief":
        """Return the parts of a mask."""
        return Relief(*(column[rows] for column in self))

    def mean(self) -> "Relief":
        """One part that all paths are off."""
        values = []
        for value, std in ((self.offset, self.offset_std), (self.turn, self.turn_std)):
            weight = 1 / std**2
            values.append((np.array([np.sum(weight * value) / weight.sum()]), np.array([weight.sum() ** -0.5])))
        (offset, offset_std), (turn, turn_std) = values
        return Relief(offset, turn, offset_std, turn_std, *(column[:1] for column in self[4:]))

    def scatter(self) -> tuple[float, float]:
        """Most likely relief [m] and tilt [degree]: the variances beyond those of the errors."""
        found = []
        for value, std in ((self.offset, self.offset_std), (self.turn, self.turn_std)):
            variance = 0.0
            for _ in range(ROUNDS):
                weight = 1 / (variance + std**2) ** 2
                variance = max(float(np.sum(weight * (value**2 - std**2)) / weight.sum()), 0.0)
            found.append(np.sqrt(variance))
        return found[0], found[1]

    def log_density(self, relief: float, tilt: float) -> FloatArray:
        """Log density (path,) of the parts [1/(m degree)]."""
        a, b = relief**2 + self.offset_std**2, tilt**2 + self.turn_std**2
        return np.asarray(-np.log(2 * np.pi) - np.log(a * b) / 2 - self.offset**2 / (2 * a) - self.turn**2 / (2 * b))

    def widths(self, relief: float, tilt: float) -> FloatArray:
        """Standard deviations (path, 2) that the scatter gives length [m] and azimuth [degree]."""
        azimuth = np.hypot(self.azimuth_by_offset * relief, self.azimuth_by_turn * tilt)
        return np.stack([self.length_by_offset * relief, azimuth], axis=-1)


def relief_of(paths: Paths, line: Line) -> Relief:
    """Parts that paths, whose errors are those of measurement, are off, about a plane."""
    columns, frame = paths.columns, line.frame()
    found = residuals(columns, frame)
    along = frame.along(np.stack(frame.reflection_points(columns), axis=-1))
    # turned about the reflection point and not about the pivot: the line there moves by -along per radian
    by_turn = found.azimuth_by_normal + found.azimuth_by_offset * np.deg2rad(along)
    by_turn = np.where(np.abs(by_turn) > MIN_SLOPE, by_turn, MIN_SLOPE)
    offset = found.length / found.length_by_offset
    return Relief(
        offset,
        (found.azimuth - found.azimuth_by_offset * offset) / by_turn,
        columns.length_std / np.abs(found.length_by_offset),
        np.hypot(columns.azimuth_std, found.azimuth_by_offset / found.length_by_offset * columns.length_std)
        / np.abs(by_turn),
        np.abs(found.length_by_offset),
        found.azimuth_by_offset,
        by_turn,
    )


def relief_and_tilt(wall: Wall) -> tuple[float, float]:
    """Relief [m] and tilt [degree] that the errors of a wall's paths contain; NaN without any."""
    rough = wall.paths.scatter[:, 0] > 0
    if not rough.any():
        return np.nan, np.nan
    parts = relief_of(wall.paths, wall.line).take(rough)
    of_length, of_azimuth = wall.paths.scatter[rough].T
    relief = float(np.median(of_length / parts.length_by_offset))
    turned = of_azimuth**2 - (parts.azimuth_by_offset * relief) ** 2
    return relief, float(np.sqrt(max(np.median(turned / parts.azimuth_by_turn**2), 0.0)))
