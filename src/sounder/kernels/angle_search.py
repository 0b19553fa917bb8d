"""Direction of a path in the beams around it, searched from several starts at the edge of the fan."""

import math

from sounder.kernels import beam_fit
from sounder.kernels.beam_fit import fit_angles
from sounder.kernels.compile import part
from sounder.kernels.component import AMPLITUDE_SPREAD, ELEVATION_SPREAD, NEAR, STARTS, Real, Work
from sounder.kernels.delay_fit import magnitude_variance
from sounder.kernels.view import (
    AROUND,
    BEAMWIDTH,
    HIGHEST,
    LOOK_AZIMUTH,
    LOOK_ELEVATION,
    LOWEST,
    N_AZIMUTHS,
    N_ELEVATIONS,
    NOISE,
    REACH,
    View,
    aim,
    pattern,
)

PLAUSIBLE = 9.0
"""Squared residuals, in variances, by which another direction may fit worse without being excluded: 3 deviations."""
CLEARLY = 0.25
"""Residual power, relative to that of a fit from the beam's own direction, at which a fit from outside the fan wins."""
EXPLORE, SETTLE = 8.0, 20.0
"""Most steps of a fit from one of several starts, and of the last from the best of them."""
SURELY = 1.0
"""By how much, in units of the noise power over the pattern's amplitude out there, it must be smaller besides. Just
above the fan 2 to 4 noise powers suffice, 2 to 3 standard deviations of the magnitudes; far out, where a path would
have to be 20 dB stronger than it looks, 10."""


@part
def search_angles(b: int, view: View, work: Work, row: Real) -> None:
    """Fit the angles; at the edge of the fan from several directions. ``work.bounds`` are those of the best fit.

    Beyond the edge the pattern's floor makes further minima: start from several angles, the beam's own first, and that
    one kept within half its power. One further out must fit clearly and surely better: neither interference nor noise
    must turn a weak path into a strong one out there. What is not excluded by three deviations is an error of the
    result, and how far it lies is kept in ``row``.
    """
    azimuth, elevation = view.beam[b, LOOK_AZIMUTH], view.beam[b, LOOK_ELEVATION]
    lowest, highest, reach = view.limits[LOWEST], view.limits[HIGHEST], view.limits[REACH]
    row_of_scan = b % view.grid[N_ELEVATIONS]
    top = row_of_scan == view.grid[N_ELEVATIONS] - 1
    outward = 1.0 if top else -1.0
    starts = STARTS if work.free[1] > 0.0 and (top or row_of_scan == 0) else 1
    edge = elevation + 0.5 * outward * view.limits[BEAMWIDTH]
    best = inside = math.inf
    first = elevation
    a0, a1, low, high, amplitude = azimuth, elevation, lowest, highest, 0.0
    angles = work.fit
    for start in range(starts):
        tilt, turn = (start + 2) // 3, start % 3 - 1 if start else 0
        angles[0] = azimuth + 0.4 * turn * reach
        up = elevation + 0.5 * outward * tilt * view.limits[BEAMWIDTH]
        angles[1] = lowest if up < lowest else highest if up > highest else up
        within_fan = start == 0 and starts > 1
        lower = edge if within_fan and outward < 0 else lowest
        upper = edge if within_fan and outward > 0 else highest
        bound(b, view, work, lower, upper)
        cost = fit_angles(
            view, work.magnitude, work.near, magnitude_variance(view, b), work.bounds, work.free, EXPLORE, angles
        )
        work.tried[start, 0], work.tried[start, 1], work.tried[start, 2] = angles[1], angles[2], cost
        aim(angles[0], angles[1], work.direction)
        seen = pattern(view, work.direction, b, work.slopes)
        surely = cost < inside - SURELY * view.beam[b, NOISE] / seen
        if start == 0 or outward * (angles[1] - edge) <= 0.0:
            accepted = start == 0 or outward * (angles[1] - first) <= 0.0 or surely
            if accepted and cost < inside:
                inside = cost
        else:
            accepted = surely and cost < CLEARLY * inside
        if start == 0:
            first = angles[1]
        if accepted and cost < best:
            best, amplitude = cost, angles[2]
            a0, a1, low, high = angles[0], angles[1], lower, upper
    angles[0], angles[1] = a0, a1
    bound(b, view, work, low, high)
    left = -2.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        left += 1.0
    variance = magnitude_variance(view, b)
    if left > 1.0 and best / (left - 1.0) > variance:
        variance = best / (left - 1.0)
    row[ELEVATION_SPREAD] = row[AMPLITUDE_SPREAD] = 0.0
    for start in range(starts):
        if work.tried[start, 2] < best + PLAUSIBLE * variance:
            further, stronger = work.tried[start, 0] - a1, work.tried[start, 1] - amplitude
            if abs(further) > abs(row[ELEVATION_SPREAD]):
                row[ELEVATION_SPREAD] = further
            if abs(stronger) > abs(row[AMPLITUDE_SPREAD]):
                row[AMPLITUDE_SPREAD] = stronger


@part
def neighbours(b: int, view: View, work: Work) -> None:
    """List a beam and those around it that were recorded, and tell which angles they determine."""
    n_azimuths, n_elevations, around = view.grid[N_AZIMUTHS], view.grid[N_ELEVATIONS], view.grid[AROUND]
    a, e = b // n_elevations, b % n_elevations
    count = 0
    work.free[0] = work.free[1] = 0.0
    for da in range(-1, 2):
        for de in range(-1, 2):
            na, ne = a + da, e + de
            if around:
                na = na % n_azimuths
            if na < 0 or na >= n_azimuths or ne < 0 or ne >= n_elevations:
                continue
            if n_azimuths < 3 and da == 1 and around:
                continue  # the same beam as da == -1
            other = na * n_elevations + ne
            if math.isnan(view.beam[other, NOISE]):
                continue
            work.near[count] = other
            count += 1
            if da != 0:
                work.free[0] = 1.0
            if de != 0:
                work.free[1] = 1.0
    work.near[count] = -1


@part
def bound(b: int, view: View, work: Work, lower: float, upper: float) -> None:
    """Set the bounds of a fit: about the beam in azimuth, as given in elevation."""
    azimuth, reach = view.beam[b, LOOK_AZIMUTH], view.limits[REACH]
    work.bounds[0], work.bounds[1], work.bounds[2], work.bounds[3] = azimuth - reach, azimuth + reach, lower, upper


@part
def weigh(view: View, work: Work) -> float:
    """Weigh the beams of the fit with their patterns toward its direction; return the sum of squares."""
    aim(work.fit[beam_fit.AZIMUTH], work.fit[beam_fit.ELEVATION], work.direction)
    energy = 0.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        work.weight[i] = pattern(view, work.direction, work.near[i], work.slopes)
        energy += work.weight[i] ** 2
    return energy
