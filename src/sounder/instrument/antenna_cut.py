"""Gain of a principal cut between the angles at which it was measured."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sounder.instrument.antenna_description import Antenna

Real = NDArray[np.float64]


class Gap(NamedTuple):
    """How well a cut is known between its rows."""

    cut: str
    """``azimuth`` or ``elevation``."""
    step: float
    """Largest distance of rows within half power [degree]."""
    error: float
    """Gain between rows [dB]."""


def between_rows(at: ArrayLike, angle: Sequence[float] | Real, level: Sequence[float] | Real) -> Real:
    """Level of a cut [dB] at angles, from its rows.

    Akima's piecewise cubic: exact for a parabola on even steps, as which the main lobe of a horn is in dB, and without
    overshoot beside a floor. Lines between rows would be ``1.5 (step / hpbw)^2`` dB too low in the middle of a Gaussian
    lobe's half-power width. Outside of the rows the first and the last level hold.

    Source: Akima, A new method of interpolation and smooth curve fitting based on local procedures, J. ACM 17(4), 1970.

    Examples
    --------
    A Gaussian lobe of 10 degrees, in rows of 5 degrees: 2.5 degrees off, it has -0.75 dB, and a line would have -1.5.

    >>> rows = np.arange(-20.0, 21.0, 5.0)
    >>> between_rows([0.0, 2.5, 90.0], rows, -12 * (rows / 10) ** 2).round(3).tolist()
    [0.0, -0.75, -48.0]
    """
    from scipy.interpolate import Akima1DInterpolator  # slow to import

    rows = np.asarray(angle, float)
    return np.asarray(Akima1DInterpolator(rows, np.asarray(level, float))(np.clip(at, rows[0], rows[-1])))


def widest_gap(antenna: Antenna) -> Gap | None:
    """The worse of the two cuts between its rows, within half power; None of an antenna without cuts.

    Every second row is predicted from the others. Half the step divides the error of any interpolation of second order
    by four or more.
    """
    if antenna.cut is None:
        return None
    angle = np.array(antenna.cut.angle)
    gaps = []
    for cut, width in (("azimuth", antenna.hpbw_azimuth), ("elevation", antenna.hpbw_elevation)):
        level = np.array(getattr(antenna.cut, cut))
        inside = np.abs(angle) <= (width or np.inf) / 2
        error = 0.0
        for first in (0, 1):
            kept = slice(first, None, 2)
            if angle[kept].size > 1:
                missed = np.abs(between_rows(angle, angle[kept], level[kept]) - level)
                error = max(error, float(missed[inside & (angle >= angle[kept][0]) & (angle <= angle[kept][-1])].max()))
        gaps.append(Gap(cut, float(np.diff(angle)[inside[1:] | inside[:-1]].max()), error / 4))
    return max(gaps, key=lambda gap: gap.error)
