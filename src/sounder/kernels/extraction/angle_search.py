"""Direction of a path in the beams around it, searched from several starts at the edge of the fan."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.beam_fit import AMPLITUDE, AZIMUTH, ELEVATION, fit_angles
from sounder.kernels.extraction.columns import AMPLITUDE_SPREAD, ELEVATION_SPREAD, NEAR, STARTS, Real, Work
from sounder.kernels.extraction.delay_fit import magnitude_variance
from sounder.kernels.extraction.scan_view import (
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
from sounder.kernels.extraction.sidelobe_check import judge

COST, HEARD = 3, 4
"""Columns of `Work.tried` after azimuth, elevation and amplitude: squared residuals, and the far beams' judgement."""
PLAUSIBLE = 9.0
"""Squared residuals, in variances, at which the far beams exclude a direction: 3 deviations."""
LIKELY = 6.0
"""The same by which another direction is 20 times less likely, and no longer an error of the one chosen."""
RARER = 4.0 / math.log(10.0)
"""The same by which a path e times as strong is less likely beforehand: of every 10 dB more there are e times fewer."""
TOLD = 4.0
"""Squared deviations by which the far beams must speak for another direction before they are believed: 2."""
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
    one kept within half its power.
    """
    azimuth, elevation = view.beam[b, LOOK_AZIMUTH], view.beam[b, LOOK_ELEVATION]
    lowest, highest, reach = view.limits[LOWEST], view.limits[HIGHEST], view.limits[REACH]
    row_of_scan = b % view.grid[N_ELEVATIONS]
    top = row_of_scan == view.grid[N_ELEVATIONS] - 1
    outward = 1.0 if top else -1.0
    starts = STARTS if work.free[1] > 0.0 and (top or row_of_scan == 0) else 1
    edge = elevation + 0.5 * outward * view.limits[BEAMWIDTH]
    angles, tried = work.fit, work.tried
    for start in range(starts):
        tilt, turn = (start + 2) // 3, start % 3 - 1 if start else 0
        angles[0] = azimuth + 0.4 * turn * reach
        up = elevation + 0.5 * outward * tilt * view.limits[BEAMWIDTH]
        angles[1] = lowest if up < lowest else highest if up > highest else up
        within_fan = start == 0 and starts > 1
        lower = edge if within_fan and outward < 0 else lowest
        upper = edge if within_fan and outward > 0 else highest
        bound(b, view, work, lower, upper)
        tried[start, COST] = fit_beams(b, view, work, EXPLORE)
        for column in range(3):
            tried[start, column] = angles[column]
        tried[start, HEARD] = judge(view, work) if starts > 1 else 0.0
    best = _choose(b, view, work, starts, outward, edge, row)
    angles[0], angles[1] = tried[best, AZIMUTH], tried[best, ELEVATION]
    within_fan = best == 0 and starts > 1
    lower = edge if within_fan and outward < 0 else lowest
    upper = edge if within_fan and outward > 0 else highest
    bound(b, view, work, lower, upper)


@part
def fit_beams(b: int, view: View, work: Work, steps: float) -> float:
    """Fit the angles in ``work.fit`` to the magnitudes in the beams of the fit; return the squared residuals."""
    noise = magnitude_variance(view, b)
    scratch = work.direction, work.slopes, work.sums
    return fit_angles(view, work.magnitude, work.near, noise, work.bounds, work.free, steps, *scratch, work.fit)


@part
def _choose(b: int, view: View, work: Work, starts: int, outward: float, edge: float, row: Real) -> int:
    """Choose among the directions tried; what is not excluded is an error of the result, kept in ``row``.

    A direction further out than the beam's own half power must fit clearly and surely better than the best within:
    neither interference nor noise must turn a weak path into a strong one out there. Or the far beams must speak for
    it, and not against it.
    """
    tried, inside, best = work.tried, 0, -1
    noise = view.beam[b, NOISE]
    for start in range(1, starts):
        out = outward * tried[start, ELEVATION]
        if out <= outward * edge and tried[start, COST] < tried[inside, COST]:
            nearer = out <= outward * tried[0, ELEVATION]
            if nearer or tried[start, COST] < tried[inside, COST] - SURELY * noise / _seen(b, view, work, start):
                inside = start
    variance = _variance(view, work, b, tried[inside, COST])
    silent = tried[inside, HEARD] if tried[inside, HEARD] < PLAUSIBLE else PLAUSIBLE
    for start in range(1, starts):
        cost, heard = tried[start, COST], silent - tried[start, HEARD]
        if outward * tried[start, ELEVATION] <= outward * edge or heard < -PLAUSIBLE:
            continue
        fits = cost < CLEARLY * tried[inside, COST]
        fits = fits and cost < tried[inside, COST] - SURELY * noise / _seen(b, view, work, start)
        told = heard > TOLD and cost < tried[inside, COST] + variance * heard
        if (told or fits) and (best < 0 or _total(work, start, variance) < _total(work, best, variance)):
            best = start
    if best < 0:
        best = inside
    variance = _variance(view, work, b, tried[best, COST])
    most = _total(work, best, variance) + LIKELY * variance
    row[ELEVATION_SPREAD] = row[AMPLITUDE_SPREAD] = 0.0
    for start in range(starts):
        ratio = math.log(tried[start, AMPLITUDE] / tried[best, AMPLITUDE])
        if _total(work, start, variance) + RARER * ratio * variance < most:
            further = tried[start, ELEVATION] - tried[best, ELEVATION]
            stronger = tried[best, AMPLITUDE] * ratio
            if abs(further) > abs(row[ELEVATION_SPREAD]):
                row[ELEVATION_SPREAD] = further
            if abs(stronger) > abs(row[AMPLITUDE_SPREAD]):
                row[AMPLITUDE_SPREAD] = stronger
    return best


@part
def _total(work: Work, start: int, variance: float) -> float:
    """Squared residuals of a direction tried in the beams about it, and in those far from it."""
    return work.tried[start, COST] + variance * work.tried[start, HEARD]


@part
def _seen(b: int, view: View, work: Work, start: int) -> float:
    """Amplitude of a beam's pattern toward a direction tried."""
    aim(work.tried[start, AZIMUTH], work.tried[start, ELEVATION], work.direction)
    return pattern(view, work.direction, b, work.slopes)


@part
def _variance(view: View, work: Work, b: int, cost: float) -> float:
    """Variance of the magnitudes: the larger of the noise's and what a fit left."""
    left = -2.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        left += 1.0
    variance = magnitude_variance(view, b)
    return cost / (left - 1.0) if left > 1.0 and cost / (left - 1.0) > variance else variance


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
    aim(work.fit[AZIMUTH], work.fit[ELEVATION], work.direction)
    energy = 0.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        weight = pattern(view, work.direction, work.near[i], work.slopes)
        work.weight[i] = weight
        energy += weight * weight
    return energy
