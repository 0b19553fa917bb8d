"""One path in the beams: fit it, take it out, put it back."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels import beam_fit
from sounder.kernels.beam_fit import fit_angles
from sounder.kernels.compile import part
from sounder.kernels.pulse import add, match, power_around, sample
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
    OVER,
    REACH,
    SPREAD,
    View,
    aim,
    pattern,
)

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Beams = npt.NDArray[np.complex64]

(
    DELAY,
    AZIMUTH,
    ELEVATION,
    AMPLITUDE,
    AZIMUTH_STD,
    ELEVATION_STD,
    AMPLITUDE_STD,
    LEFT_OVER,
    BEAM,
    OFF_BORESIGHT,
    ENERGY,
    LOWER,
    UPPER,
    ELEVATION_SPREAD,
    AMPLITUDE_SPREAD,
) = range(15)
"""Columns of the result; the last are the power that the fit left around the peak, the beam it was found in, the
pattern's amplitude from that beam toward it, its squares summed over the beams of the fit, and the elevations between
which it was fitted, and how far other directions lie that the beams do not exclude."""
COLUMNS = 15
STARTS = 10
"""Directions that an angle fit at the edge of the fan starts from."""
PLAUSIBLE = 9.0
"""Squared residuals, in variances, by which another direction may fit worse without being excluded: 3 deviations."""
NEAR = 9
"""Beams of a fit: the one it was found in and those around it."""
CLEARLY = 0.25
"""Residual power, relative to that of a fit from the beam's own direction, at which a fit from outside the fan wins."""
EXPLORE, SETTLE = 8, 20
"""Most steps of a fit from one of several starts, and of the last from the best of them."""
SURELY = 1.0
"""By how much, in units of the noise power over the pattern's amplitude out there, it must be smaller besides. Just
above the fan 2 to 4 noise powers suffice, 2 to 3 standard deviations of the magnitudes; far out, where a path would
have to be 20 dB stronger than it looks, 10."""


class Work(NamedTuple):
    """Scratch of a fit: taps of the pulse and of the matched filter, beams, their weights, angles, bounds."""

    pulse: Complex
    matched: Complex
    inner: Complex
    near: npt.NDArray[np.int64]
    weight: Real
    magnitude: Real
    free: Real
    bounds: Real
    fit: Real
    direction: Real
    slopes: Real
    tried: Real


def work_of(view: View) -> Work:
    """Allocate what fits with this view need."""
    pulse, matched = (2 * (table.size // (2 * int(view.grid[OVER])) - 1) + 1 for table in (view.pulse, view.matched))
    return Work(
        np.empty(pulse, complex),
        np.empty(matched, complex),
        np.empty(matched, complex),
        np.empty(NEAR + 1, np.int64),
        *(np.empty(size) for size in (NEAR, NEAR, 2, 4, 6, 4, 2, (STARTS, 3))),
    )


@part
def fit(beams: Beams, view: View, work: Work, row: Real, anew: bool) -> None:
    """Delay and angles from the beam that a path was found in and its neighbours, each given the other.

    ``row`` holds the beam and a first delay and, unless they are to be searched ``anew``, the angles. With a phase of
    its own in every beam, the likelihood is largest where ``sum_b g_b |c_b(delay)|`` is, ``c_b`` being the output of
    the matched filter and ``g_b`` the pattern.
    """
    b = int(row[BEAM])
    delay = row[DELAY]
    angles = work.fit
    if anew:
        work.near[0], work.near[1], work.weight[0] = b, -1, 1.0
        delay = _climb(beams, view, work, delay, 0.5)
        _neighbours(b, view, work)
        _measure(beams, view, work, delay)
        _search_angles(b, view, work, row)
    else:
        _neighbours(b, view, work)
        angles[beam_fit.AZIMUTH], angles[beam_fit.ELEVATION] = row[AZIMUTH], row[ELEVATION]
        _bound(b, view, work, row[LOWER], row[UPPER])
    _weigh(view, work)
    delay = _climb(beams, view, work, delay, 0.15)
    _measure(beams, view, work, delay)
    fit_angles(view, work.magnitude, work.near, _variance(view, b), work.bounds, work.free, SETTLE, angles)
    for column in range(6):
        row[AZIMUTH + column] = angles[column]
    row[ELEVATION_STD] = math.hypot(row[ELEVATION_STD], row[ELEVATION_SPREAD])
    row[AMPLITUDE_STD] = math.hypot(row[AMPLITUDE_STD], row[AMPLITUDE_SPREAD])
    row[DELAY], row[LOWER], row[UPPER] = delay, work.bounds[2], work.bounds[3]
    row[ENERGY] = _weigh(view, work)
    row[OFF_BORESIGHT] = pattern(view, work.direction, b, work.slopes)


@part
def _bound(b: int, view: View, work: Work, lower: float, upper: float) -> None:
    """Set the bounds of a fit: about the beam in azimuth, as given in elevation."""
    azimuth, reach = view.beam[b, LOOK_AZIMUTH], view.limits[REACH]
    work.bounds[0], work.bounds[1], work.bounds[2], work.bounds[3] = azimuth - reach, azimuth + reach, lower, upper


@part
def _weigh(view: View, work: Work) -> float:
    """Weigh the beams of the fit with their patterns toward its direction; return the sum of squares."""
    aim(work.fit[beam_fit.AZIMUTH], work.fit[beam_fit.ELEVATION], work.direction)
    energy = 0.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        work.weight[i] = pattern(view, work.direction, work.near[i], work.slopes)
        energy += work.weight[i] ** 2
    return energy


@part
def _variance(view: View, b: int) -> float:
    """Variance of a path's magnitude in a beam."""
    return 0.5 * view.limits[SPREAD] * view.beam[b, NOISE]


@part
def _tune(view: View, work: Work, delay: float) -> int:
    """Fill ``work.matched`` so that it measures the amplitude of a path at ``delay``; return its first sample."""
    over = view.grid[OVER]
    first = sample(view.matched, over, delay, work.matched)
    sample(view.pulse, over, delay, work.inner)
    energy = 0j
    for i in range(work.matched.size):
        energy += work.inner[i] * work.matched[i]
    scale = 1.0 / energy
    for i in range(work.matched.size):
        work.matched[i] *= scale
    return first


@part
def _climb(beams: Beams, view: View, work: Work, delay: float, step: float) -> float:
    """Delay [sample] at which the weighted magnitudes are largest, within two steps or so.

    Parabolas through three points, over two steps: the sum is smooth and has one maximum over the main lobe.
    """
    for _ in range(2):
        before = _height(beams, view, work, delay - step)
        here = _height(beams, view, work, delay)
        after = _height(beams, view, work, delay + step)
        move = 1.0 if after > before else -1.0
        curvature = before - 2 * here + after
        if curvature < 0.0 and abs(before - after) < -2 * curvature:
            move = 0.5 * (before - after) / curvature
        delay += step * move
        step *= 0.3
    return delay


@part
def _height(beams: Beams, view: View, work: Work, delay: float) -> float:
    first = _tune(view, work, delay)
    total = 0.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        total += work.weight[i] * abs(match(beams, work.near[i], first, work.matched))
    return total


@part
def _neighbours(b: int, view: View, work: Work) -> None:
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
def _measure(beams: Beams, view: View, work: Work, delay: float) -> None:
    """Magnitude of the path in each beam of the fit; what noise adds to it on average is taken off."""
    first = _tune(view, work, delay)
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        value = match(beams, work.near[i], first, work.matched)
        power = value.real**2 + value.imag**2 - _variance(view, work.near[i])
        work.magnitude[i] = math.sqrt(power) if power > 0.0 else 0.0


@part
def _search_angles(b: int, view: View, work: Work, row: Real) -> None:
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
        _bound(b, view, work, lower, upper)
        cost = fit_angles(view, work.magnitude, work.near, _variance(view, b), work.bounds, work.free, EXPLORE, angles)
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
    _bound(b, view, work, low, high)
    left = -2.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        left += 1.0
    variance = _variance(view, b)
    if left > 1.0 and best / (left - 1.0) > variance:
        variance = best / (left - 1.0)
    row[ELEVATION_SPREAD] = row[AMPLITUDE_SPREAD] = 0.0
    for start in range(starts):
        if work.tried[start, 2] < best + PLAUSIBLE * variance:
            row[ELEVATION_SPREAD] = max(row[ELEVATION_SPREAD], abs(work.tried[start, 0] - a1))
            row[AMPLITUDE_SPREAD] = max(row[AMPLITUDE_SPREAD], abs(work.tried[start, 1] - amplitude))


@part
def take(beams: Beams, view: View, margin: float, work: Work, row: Real, taken: Beams, i: int) -> None:
    """Take path ``i`` out of every beam in which the pattern lets it stand above a tenth of the noise."""
    first = _tune(view, work, row[DELAY])
    first_of_pulse = sample(view.pulse, view.grid[OVER], row[DELAY], work.pulse)
    found_in = int(row[BEAM])
    aim(row[AZIMUTH], row[ELEVATION], work.direction)
    for b in range(beams.shape[0]):
        taken[i, b] = 0
        noise = view.beam[b, NOISE]
        if math.isnan(noise):
            continue
        predicted = row[AMPLITUDE] * pattern(view, work.direction, b, work.slopes)
        if predicted**2 < 0.1 * noise and b != found_in:
            continue
        amplitude = match(beams, b, first, work.matched)
        size = abs(amplitude)
        if size > margin * predicted and b != found_in:
            amplitude *= predicted / size
        taken[i, b] = amplitude
        add(beams, b, first_of_pulse, work.pulse, -amplitude)


@part
def fit_again(beams: Beams, view: View, margin: float, work: Work, row: Real, taken: Beams, i: int, anew: bool) -> None:
    """Put path ``i`` back and fit it to what the others left."""
    first = sample(view.pulse, view.grid[OVER], row[DELAY], work.pulse)
    for b in range(beams.shape[0]):
        if taken[i, b] != 0:
            add(beams, b, first, work.pulse, taken[i, b])
    fit(beams, view, work, row, anew)
    take(beams, view, margin, work, row, taken, i)
    row[LEFT_OVER] = power_around(beams, int(row[BEAM]), row[DELAY])
