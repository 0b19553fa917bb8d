"""The offset of gains that all measurements share.

A direct path has the gain of free space, less what obstructs it. The excess of its gain over that of free space is
therefore ``g + noise``, or less by up to `OBSTRUCTION`; ``g`` is the offset. Where no direct path was received, no path
is stronger than free space, and the strongest reflections lose little.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import UNKNOWN_GAIN_STD, robust_std
from erm.mpcs.table import free_space_gain
from erm.survey.direct_paths import FALSE_MPCS
from erm.survey.observations import Observations

USUAL_GAIN = 3.0
"""Half of all tables have gains that are wrong by less [dB]: scale of a Cauchy prior; chosen."""
CLEAR_STD = 1.5
"""Deviation of gains of direct paths from free space [dB]: antenna patterns and the ground; chosen."""
CLEAR_SHARE = 0.7
"""Share of direct paths that are not obstructed; chosen."""
OBSTRUCTION = 25.0
"""Largest loss of an obstructed direct path [dB]."""
LEAST_STD = 0.1
"""Smallest standard error of an offset [dB]: antenna patterns are not known better."""
STRONGEST_LOSS, STRONGEST_LOSS_STD = 4.0, 4.0
"""Loss of the strongest reflections of a table [dB]: grazing ones lose 1, those off concrete at normal incidence 8."""
LEAST_COMMON, FEWEST_SPREAD = 0.3, 5
"""Share of direct paths that must agree on a common offset, of at least so many; otherwise each position has its own.
Chosen: half of what `CLEAR_SHARE` expects."""
FEWEST = 2
"""Fewest direct paths that show an offset."""


def offset_likelihood(excess: FloatArray) -> FloatArray:
    """Log-likelihood (path,) of the excess gains of direct paths, if the path is a clear one, with the prior.

    Parameters
    ----------
    excess : array (path,)
        Gains minus those of free space [dB].

    Examples
    --------
    >>> excess = np.array([10.2, 9.8, 10.0, -4.0])
    >>> round(float(excess[np.argmax(offset_likelihood(excess))]))
    10
    """
    away = excess[:, None] - excess  # of each path from the one that is taken for clear
    return np.asarray(np.log(_density(away)).sum(axis=0) - np.log1p((excess / USUAL_GAIN) ** 2))


class GainOffset(NamedTuple):
    """Offset of the gains, measured minus true [dB]."""

    offset: float
    std: float
    """Standard error."""
    spread: float = 0.0
    """Standard deviation of the offsets of single positions, where each has its own."""


def gain_offset(seen: Observations, clock: float, direct: npt.NDArray[np.bool_]) -> GainOffset:
    """Offset of the gains from direct paths, or else from the strongest reflections.

    Parameters
    ----------
    seen : Observations
        MPCs of all antenna pairs.
    clock : float
        Error of the lengths [m].
    direct : array (mpc,) of bool
        Which MPCs are direct paths.
    """
    known = np.isfinite(seen.gain) & (seen.length > clock)
    if not known.any():
        return GainOffset(0.0, UNKNOWN_GAIN_STD)
    length = np.where(known, seen.length - clock, 1.0)
    excess = seen.gain - free_space_gain(length, seen.frequency)
    if np.count_nonzero(known & direct) < FEWEST:
        strongest = np.full(len(seen.tx), -np.inf)
        np.maximum.at(strongest, seen.link[known], excess[known])
        # a tenth may be stronger: false MPCs, and two paths in one cell
        offset = float(np.quantile(strongest[np.isfinite(strongest)], 0.9)) + STRONGEST_LOSS
        return GainOffset(offset, STRONGEST_LOSS_STD)
    chosen = excess[known & direct]
    offset = float(chosen[np.argmax(offset_likelihood(chosen))])
    for _ in range(10):
        away = chosen - offset
        clear = CLEAR_SHARE * _clear(away) / _density(away)
        offset = float(np.average(chosen, weights=clear))
    if len(chosen) >= FEWEST_SPREAD and clear.sum() < LEAST_COMMON * len(chosen):
        offset = float(np.median(chosen))
        spread = robust_std(chosen - offset)
        return GainOffset(offset, spread / np.sqrt(len(chosen)), spread)
    variance = np.average((chosen - offset) ** 2, weights=clear)
    return GainOffset(offset, float(np.sqrt(variance / clear.sum()) + LEAST_STD))


def _clear(away: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-((away / CLEAR_STD) ** 2) / 2) / (CLEAR_STD * np.sqrt(2 * np.pi)))


def _density(away: FloatArray) -> FloatArray:
    """Density of differences from the offset [1/dB]: clear, obstructed, or something else."""
    obstructed = ((away < 0) & (away > -OBSTRUCTION)) / OBSTRUCTION
    usual = CLEAR_SHARE * _clear(away) + (1 - CLEAR_SHARE) * obstructed
    return np.asarray((1 - FALSE_MPCS) * usual + FALSE_MPCS / 100)
