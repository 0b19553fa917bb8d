"""One path in the beams: fit it, take it out, put it back."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.beam_fit import beam_amplitude, fit_angles
from sounder.kernels.compile import part
from sounder.kernels.pulse import add_pulse, amplitude_at, fit_delay

Real = npt.NDArray[np.float64]
Beams = npt.NDArray[np.complex64]


class View(NamedTuple):
    """What the beams see a path with.

    Attributes
    ----------
    noise : array (beam,)
        Mean power of the noise; NaN for beams that were not recorded.
    looks : array (beam, 2)
        Where each beam looks [degree].
    grid : array (3,)
        Number of azimuths and elevations, and whether the azimuths close a circle.
    limits : array (4,)
        How far from its beam a path may be fitted in azimuth; lowest and highest elevation; half-power beamwidth in
        elevation [degree].
    azimuth_cut, elevation_cut, floor
        The pattern [dB]; see :mod:`sounder.kernels.beam_fit`.
    table, over
        The pulse; see :mod:`sounder.kernels.pulse`.
    """

    noise: Real
    looks: Real
    grid: npt.NDArray[np.int64]
    limits: Real
    azimuth_cut: Real
    elevation_cut: Real
    floor: float
    table: npt.NDArray[np.complex128]
    over: int


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
) = range(10)
"""Columns of the result; the last are the power that the fit left around the peak, the beam it was found in, and the
pattern's amplitude from that beam toward it."""
COLUMNS = 10
CLEARLY = 0.25
"""Residual power, relative to that of a fit from the beam's own direction, at which a fit from outside the fan wins."""
SURELY = 1.0
"""By how much, in units of the noise power over the pattern's amplitude out there, it must be smaller besides. Just
above the fan 2 to 4 noise powers suffice, 2 to 3 standard deviations of the magnitudes; far out, where a path would
have to be 20 dB stronger than it looks, 10."""


@part
def toward(view: View, azimuth: float, elevation: float, b: int) -> float:
    """Amplitude of a beam's pattern toward a direction, relative to its boresight."""
    return beam_amplitude(
        azimuth, elevation, view.looks[b, 0], view.looks[b, 1], view.azimuth_cut, view.elevation_cut, view.floor
    )


@part
def fit(
    beams: Beams,
    b: int,
    start: float,
    view: View,
    row: Real,
) -> None:
    """Delay from the strongest beam, then angles and amplitude from it and its neighbours."""
    delay = fit_delay(beams[b], view.table, view.over, start)
    n_azimuths, n_elevations = view.grid[0], view.grid[1]
    a, e = b // n_elevations, b % n_elevations
    magnitude = np.empty(9)
    near = np.empty((9, 2))
    beam_count = 0
    free = np.zeros(2, np.bool_)
    for da in range(-1, 2):
        for de in range(-1, 2):
            na, ne = a + da, e + de
            if view.grid[2]:
                na = na % n_azimuths
            if na < 0 or na >= n_azimuths or ne < 0 or ne >= n_elevations:
                continue
            if n_azimuths < 3 and da == 1 and view.grid[2]:
                continue  # the same beam as da == -1
            other = na * n_elevations + ne
            if not np.isfinite(view.noise[other]):
                continue
            power = abs(amplitude_at(beams[other], view.table, view.over, delay)) ** 2 - 0.5 * view.noise[other]
            magnitude[beam_count] = np.sqrt(max(power, 0.0))
            near[beam_count] = view.looks[other]
            beam_count += 1
            free[0] |= da != 0
            free[1] |= de != 0
    start_angles = view.looks[b].copy()
    lower = np.array([view.looks[b, 0] - view.limits[0], view.limits[1]])
    upper = np.array([view.looks[b, 0] + view.limits[0], view.limits[2]])
    result = np.empty(6)
    best = inside = np.inf
    # Beyond the edge of the fan the pattern's floor makes further minima: start from several angles, the beam's own
    # first, and that one kept within half its power. One further out must fit clearly and surely better: neither
    # interference nor noise must turn a weak path into a strong one out there.
    outward = 1 if e == n_elevations - 1 else -1
    starts = 10 if free[1] and (e == n_elevations - 1 or e == 0) else 1
    edge = view.looks[b, 1] + 0.5 * outward * view.limits[3]
    for start_ in range(starts):
        tilt, turn = (start_ + 2) // 3, start_ % 3 - 1 if start_ else 0
        start_angles[0] = view.looks[b, 0] + 0.4 * turn * view.limits[0]
        start_angles[1] = min(
            max(view.looks[b, 1] + 0.5 * outward * tilt * view.limits[3], view.limits[1]), view.limits[2]
        )
        within_fan = start_ == 0 and starts > 1
        lower[1] = edge if within_fan and outward < 0 else view.limits[1]
        upper[1] = edge if within_fan and outward > 0 else view.limits[2]
        cost = fit_angles(
            magnitude[:beam_count],
            near[:beam_count],
            start_angles,
            lower,
            upper,
            free,
            0.5 * view.noise[b],
            view.azimuth_cut,
            view.elevation_cut,
            view.floor,
            result,
        )
        near_fan = start_ == 0 or outward * (result[1] - edge) <= 0.0
        if near_fan:
            inside = min(inside, cost)
        seen = toward(view, result[0], result[1], b)
        if cost < best and (near_fan or (cost < CLEARLY * inside and cost < inside - SURELY * view.noise[b] / seen)):
            best = cost
            row[AZIMUTH : AMPLITUDE_STD + 1] = result
    row[DELAY] = delay
    row[BEAM] = b
    row[OFF_BORESIGHT] = toward(view, row[AZIMUTH], row[ELEVATION], b)


@part
def take(
    beams: Beams,
    view: View,
    margin: float,
    row: Real,
    taken: Beams,
) -> None:
    """Take a path out of every beam in which the pattern lets it stand above a tenth of the noise."""
    for b in range(beams.shape[0]):
        taken[b] = 0
        if not np.isfinite(view.noise[b]):
            continue
        g = toward(view, row[AZIMUTH], row[ELEVATION], b)
        predicted = row[AMPLITUDE] * g
        if predicted**2 < 0.1 * view.noise[b] and b != int(row[BEAM]):
            continue
        amplitude = amplitude_at(beams[b], view.table, view.over, row[DELAY])
        size = abs(amplitude)
        if size > margin * predicted and b != int(row[BEAM]):
            amplitude *= predicted / size
        taken[b] = amplitude
        add_pulse(beams[b], view.table, view.over, row[DELAY], -amplitude)


@part
def give_back(beams: Beams, view: View, row: Real, taken: Beams) -> None:
    """Put back what was taken out."""
    for b in range(beams.shape[0]):
        if taken[b] != 0:
            add_pulse(beams[b], view.table, view.over, row[DELAY], taken[b])


@part
def fit_again(
    beams: Beams,
    view: View,
    margin: float,
    row: Real,
    taken: Beams,
) -> None:
    """Put a path back and fit it to what the others left."""
    give_back(beams, view, row, taken)
    b = int(row[BEAM])
    fit(beams, b, row[DELAY], view, row)
    take(beams, view, margin, row, taken)
    row[LEFT_OVER] = power_around(beams[b], row[DELAY])


@part
def power_around(row: Beams, delay: float) -> float:
    """Mean power within two samples of a delay."""
    centre = round(delay)
    total = 0.0
    for k in range(centre - 2, centre + 3):
        value = row[k % row.size]
        total += value.real**2 + value.imag**2
    return total / 5
