"""Paths from directions that were not recorded: what other beams see of them is no path of its own."""

import numpy as np
from numpy.typing import NDArray

from sounder.kernels.extraction.records import ARRIVAL
from sounder.kernels.extraction.sidelobe_check import FAR_BEAM_DISTANCE
from sounder.mpc.directions import wrap
from sounder.mpc.scan import Scan

Paths = NDArray[np.record]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]


def stand_out(found: Paths, scan: Scan) -> Mask:
    """Whether the direction of each path (mpc,) is known, though a stronger path may come from a missing direction.

    A path that is in the main lobe of no recorded beam enters all of them through their sidelobes, which the pattern
    describes within a margin: a peak that does not exceed the median of the far beams by that margin may be one of
    its sidelobes. The beams beside the missing ones see its flank. Where the next two beams on one side of a path's are
    missing it may come from there, unless those on the other side see it as clearly; one beyond the edge of the fan may
    come from any beam that is missing on the inner side.
    """
    beams, view = scan.arrival, scan.arrival.view(end=ARRIVAL, stride=1)
    known = np.ones(len(found), bool)
    if not beams.pattern.directive:
        return known
    azimuth, margin = beams.directions[:, 0], scan.pattern_margin**2
    fan = scan.elevation.min() - scan.beamwidth[1] / 2, scan.elevation.max() + scan.beamwidth[1] / 2
    outside = (found["elevation"] < fan[0]) | (found["elevation"] > fan[1])
    for p, path in enumerate(found):
        departure, own = divmod(int(path["beam"]), beams.size)
        links = departure * beams.size + np.arange(beams.size)
        noise, recorded = scan.noise[links], np.isfinite(scan.noise[links])
        sample = int(np.floor(path["delay"] + 0.5)) % scan.period
        power = np.where(recorded, np.abs(scan.cir[links, sample]) ** 2, 0.0)
        far = recorded & (np.abs(wrap(azimuth - azimuth[own])) > FAR_BEAM_DISTANCE * view.azimuth_reach)
        level = float(np.median((power - noise)[far])) if far.any() else 0.0
        known[p] = (path["amplitude"] * path["beam_gain"]) ** 2 > margin * level
        for sides in _sides(own, scan, full_circle=view.full_circle):
            missing = [~recorded[side] for side in sides]
            hidden = any(gone.all() for gone in missing) or (outside[p] and any(gone.any() for gone in missing))
            if hidden:
                seen = max(power[side].max() for side in sides)
                known[p] &= not outside[p] and len(sides) > 1 and seen > margin * max(level, noise[own])
    return known


def _sides(beam: int, scan: Scan, *, full_circle: bool) -> list[list[Integers]]:
    """The next two beams of the scan on either side of a beam, in azimuth and in elevation; without sides beyond."""
    azimuths, elevations = scan.azimuth.size, scan.elevation.size
    a, e = divmod(beam, elevations)
    steps = np.array([-2, -1]), np.array([1, 2])
    columns = [(a + step) % azimuths if full_circle else (a + step)[_within(a + step, azimuths)] for step in steps]
    rows = [(e + step)[_within(e + step, elevations)] for step in steps]
    of_azimuth = [column * elevations + e for column in columns if column.size]
    return [of_azimuth, [a * elevations + row for row in rows if row.size]]


def _within(number: Integers, count: int) -> Mask:
    inside: Mask = (number >= 0) & (number < count)
    return inside
