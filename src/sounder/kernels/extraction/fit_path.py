"""One path in the beams: fit it, take it out, put it back."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction import beam_fit
from sounder.kernels.extraction.angle_search import SETTLE, bound, fit_beams, neighbours, search_angles, weigh
from sounder.kernels.extraction.columns import (
    AMPLITUDE,
    AMPLITUDE_SPREAD,
    ANEW,
    AZIMUTH,
    BEAM,
    DELAY,
    ELEVATION,
    ELEVATION_AMPLITUDE,
    ELEVATION_SPREAD,
    ENERGY,
    LEFT_OVER,
    LOWER,
    OFF_BORESIGHT,
    UPPER,
    VAR_AMPLITUDE,
    VAR_ELEVATION,
    Beams,
    Real,
    Work,
)
from sounder.kernels.extraction.delay_fit import climb, measure, tune
from sounder.kernels.extraction.pulse import add, match, power, power_around, sample
from sounder.kernels.extraction.scan_view import NOISE, OVER, View, aim, pattern
from sounder.kernels.extraction.sidelobe_check import listen


@part
def fit(beams: Beams, view: View, margin: float, work: Work, row: Real, taken: Beams, i: int, takes: bool) -> None:
    """Put path ``i`` back into the beams, fit it to what the others left and, if ``takes``, take it out again.

    ``row`` and ``taken[i]`` hold the path; of one that is new, the beam, a first delay, and zeros.
    """
    first = sample(view.pulse, view.grid[OVER], row[DELAY], work.pulse)
    for b in range(beams.shape[0]):
        if taken[i, b] != 0:
            add(beams, b, first, work.pulse, complex(taken[i, b]))  # in double precision, as `_take` adds it
    _measure(beams, view, work, row)
    if takes:
        _take(beams, view, margin, work, row, taken, i)
        row[LEFT_OVER] = power_around(beams, int(row[BEAM]), row[DELAY])


@part
def _measure(beams: Beams, view: View, work: Work, row: Real) -> None:
    """Delay and angles from the beam that a path was found in and its neighbours, each given the other.

    ``row`` holds the beam and a first delay and, unless they are to be searched anew, the angles. With a phase of
    its own in every beam, the likelihood is largest where ``sum_b g_b |c_b(delay)|`` is, ``c_b`` being the output of
    the matched filter and ``g_b`` the pattern.
    """
    b = int(row[BEAM])
    delay = row[DELAY]
    angles = work.fit
    if row[ANEW] > 0.0:
        work.near[0], work.near[1], work.weight[0] = b, -1, 1.0
        delay = climb(beams, view, work, delay, 0.5)
        neighbours(b, view, work)
        measure(beams, view, work, delay)
        listen(beams, view, work, b, delay)
        search_angles(b, view, work, row)
    else:
        neighbours(b, view, work)
        angles[beam_fit.AZIMUTH], angles[beam_fit.ELEVATION] = row[AZIMUTH], row[ELEVATION]
        bound(b, view, work, row[LOWER], row[UPPER])
    weigh(view, work)
    delay = climb(beams, view, work, delay, 0.15)
    measure(beams, view, work, delay)
    fit_beams(b, view, work, SETTLE)
    for column in range(beam_fit.RESULTS):
        row[AZIMUTH + column] = angles[column]
    row[VAR_ELEVATION] += row[ELEVATION_SPREAD] * row[ELEVATION_SPREAD]
    row[VAR_AMPLITUDE] += row[AMPLITUDE_SPREAD] * row[AMPLITUDE_SPREAD]
    row[ELEVATION_AMPLITUDE] += row[ELEVATION_SPREAD] * row[AMPLITUDE_SPREAD]
    row[DELAY], row[LOWER], row[UPPER] = delay, work.bounds[2], work.bounds[3]
    row[ENERGY] = weigh(view, work)
    row[OFF_BORESIGHT] = pattern(view, work.direction, b, work.slopes)


@part
def _take(beams: Beams, view: View, margin: float, work: Work, row: Real, taken: Beams, i: int) -> None:
    """Take path ``i`` out of every beam in which the pattern lets it stand above a tenth of the noise."""
    first = tune(view, work, row[DELAY])
    first_of_pulse = sample(view.pulse, view.grid[OVER], row[DELAY], work.pulse)
    found_in = int(row[BEAM])
    aim(row[AZIMUTH], row[ELEVATION], work.direction)
    for b in range(beams.shape[0]):
        taken[i, b] = 0
        noise = view.beam[b, NOISE]
        if math.isnan(noise):
            continue
        predicted = row[AMPLITUDE] * pattern(view, work.direction, b, work.slopes)
        if predicted * predicted < 0.1 * noise and b != found_in:
            continue
        amplitude = match(beams, b, first, work.matched)
        size = math.sqrt(power(amplitude))
        if size > margin * predicted and b != found_in:
            amplitude = complex(amplitude.real * predicted / size, amplitude.imag * predicted / size)
        taken[i, b] = amplitude
        add(beams, b, first_of_pulse, work.pulse, -amplitude)
