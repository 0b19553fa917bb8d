"""Paths from directions that were not recorded: what other beams see of them is no path of its own."""

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.kernels.extraction.records import ARRIVAL
from sounder.kernels.extraction.sidelobe_check import FAR_BEAM_DISTANCE
from sounder.mpc.directions import wrap
from sounder.mpc.scan import Scan

Real = NDArray[np.float64]
Paths = NDArray[np.record]


class Ambiguity(NamedTuple):
    """Which paths have a known direction (mpc,), and how far off in azimuth [degree] and gain [dB] they may be."""

    known: NDArray[np.bool_]
    azimuth: Real
    gain: Real


def ambiguity(found: Paths, scan: Scan) -> Ambiguity:
    """Whether the directions of paths are known, though stronger paths may come from missing directions.

    A path that is in the main lobe of no recorded beam enters all of them through their sidelobes, which the pattern
    describes within a margin: a peak that does not exceed the median of the far beams by that margin may be one of
    its sidelobes. The beams beside the missing ones see its flank. Where the next azimuth on one side of a path's beam
    is missing, the path may come from there, unless the next on the other side sees no less of it than of a path
    half-way to the missing one: azimuth and gain may be off by as much. Where then the one after it is missing too, or
    all elevations above or below, or for a path beyond the edge of the fan any of these, the direction is not known.
    """
    beams, view = scan.arrival, scan.arrival.view(end=ARRIVAL, stride=1)
    result = Ambiguity(np.ones(len(found), bool), np.zeros(len(found)), np.zeros(len(found)))
    if not beams.pattern.directive:
        return result
    azimuth, margin = beams.directions[:, 0], scan.pattern_margin**2
    fan = scan.elevation.min() - scan.beamwidth[1] / 2, scan.elevation.max() + scan.beamwidth[1] / 2
    step = float(np.diff(scan.azimuth).min()) if scan.azimuth.size > 1 else 0.0
    loss = beams.pattern.relative_gain(np.array([0.5, 1.0, 1.5]) * step, np.zeros(3))
    for p, path in enumerate(found):
        departure, own = divmod(int(path["beam"]), beams.size)
        links = departure * beams.size + np.arange(beams.size)
        noise, recorded = scan.noise[links], np.isfinite(scan.noise[links])
        sample = int(np.floor(path["delay"] + 0.5)) % scan.period
        power = np.where(recorded, np.abs(scan.cir[links, sample]) ** 2, 0.0)
        far = recorded & (np.abs(wrap(azimuth - azimuth[own])) > FAR_BEAM_DISTANCE * view.azimuth_reach)
        level = max(float(np.median((power - noise)[far])) if far.any() else 0.0, 0.0)
        known = (path["amplitude"] * path["beam_gain"]) ** 2 > margin * level
        sides, column = _around(own, scan, full_circle=view.full_circle)
        seen = max(power[side[0]] for side in sides) if sides else 0.0
        clear = len(sides) > 1 and seen > margin * max(level, noise[own])
        between = clear and seen > 10 ** ((loss[2] - loss[0]) / 10) * power[own]
        for side in sides:
            known &= between or bool(recorded[side].any())
            if not recorded[side[0]] and not between:
                result.azimuth[p] = wrap(azimuth[side[0]] - path["azimuth"])
                result.gain[p] = -loss[1]
        missing = [~recorded[side] for side in column if side]
        outside = not fan[0] <= path["elevation"] <= fan[1]
        result.known[p] = known and not any(gone.all() or (gone.any() and outside) for gone in missing)
    return result


def widen(table: xr.Dataset, azimuth: Real, gain: Real) -> None:
    """Add what azimuth [degree] and gain [dB] may be off to their standard deviations and covariance."""
    for name, index, off in (("azimuth", 1, azimuth), ("path_gain", 3, gain)):
        table[f"{name}_std"].values[:] = np.hypot(table[f"{name}_std"].values, off)
        table["covariance"].values[:, index, index] += off**2


def _around(beam: int, scan: Scan, *, full_circle: bool) -> tuple[list[list[int]], tuple[list[int], list[int]]]:
    """The next two beams on either side of a beam in azimuth, the nearer first; all below and all above it."""
    azimuths, elevations = scan.azimuth.size, scan.elevation.size
    a, e = divmod(beam, elevations)
    columns = [[a + sign * step for step in (1, 2)] for sign in (-1, 1)]
    inside = [[column % azimuths for column in side if full_circle or 0 <= column < azimuths] for side in columns]
    sides = [[column * elevations + e for column in side] for side in inside if side]
    first = a * elevations
    return sides, (list(range(first, first + e)), list(range(first + e + 1, first + elevations)))
