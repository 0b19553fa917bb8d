"""Fit of one path: add it to the samples again, fit it, subtract it."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.angle_search import (
    FINAL_STEPS,
    fit_near,
    list_neighbours,
    search_angles,
    weigh_beams,
)
from sounder.kernels.extraction.delay_fit import measure_magnitudes, refine_delay, set_filter
from sounder.kernels.extraction.pulse import Cir, add, match, power, power_around, sample
from sounder.kernels.extraction.records import Path
from sounder.kernels.extraction.scan_view import ScanView, pattern, toward
from sounder.kernels.extraction.sidelobe_check import measure_sidelobes
from sounder.kernels.extraction.workspace import Workspace


@part
def update_path(cir: Cir, view: ScanView, work: Workspace, path: Path, removed: Cir, i: int, removes: bool) -> None:
    """Add path ``i`` back to the beams, fit it to the residual of the others and, if ``removes``, subtract it again.

    ``path`` and ``removed[i]`` hold the path; for a new one the beam, a first delay, and zeros.
    """
    first = sample(view.pulse, view.oversampling, path.delay, work.pulse)
    for b in range(cir.shape[0]):
        if removed[i, b] != 0:
            add(cir, b, first, work.pulse, complex(removed[i, b]))  # in double precision, as `_remove` adds it
    _fit(cir, view, work, path)
    if removes:
        _remove(cir, view, work, path, removed, i)
        path.residual_power = power_around(cir, path.beam, path.delay)


@part
def _fit(cir: Cir, view: ScanView, work: Workspace, path: Path) -> None:
    """Delay and angles from the beam that a path was found in and its neighbours, each given the other.

    ``path`` holds the beam and a first delay and, unless they are to be searched anew, the angles. With a phase of
    its own in every beam, the likelihood is largest where ``sum_b g_b |c_b(delay)|`` is, ``c_b`` being the output of
    the matched filter and ``g_b`` the pattern.
    """
    b, delay = path.beam, path.delay
    if path.search_angles:
        work.near[0], work.near[1], work.weight[0] = b, -1, 1.0
        delay = refine_delay(cir, view, work, delay, 0.5)
        free = list_neighbours(b, view, work)
        measure_magnitudes(cir, view, work, delay)
        measure_sidelobes(cir, view, work, b, delay)
        search_angles(b, view, work, free, path)
    else:
        free = list_neighbours(b, view, work)
    weigh_beams(view, work, path)
    delay = refine_delay(cir, view, work, delay, 0.15)
    measure_magnitudes(cir, view, work, delay)
    fit_near(b, view, work, free, FINAL_STEPS, path)
    path.elevation_variance += path.elevation_spread * path.elevation_spread
    path.amplitude_variance += path.amplitude_spread * path.amplitude_spread
    path.elevation_amplitude += path.elevation_spread * path.amplitude_spread
    path.delay = delay
    path.pattern_energy = weigh_beams(view, work, path)
    path.beam_gain = pattern(view, b, toward(path.azimuth, path.elevation))[0]


@part
def _remove(cir: Cir, view: ScanView, work: Workspace, path: Path, removed: Cir, i: int) -> None:
    """Subtract path ``i`` from every beam in which the pattern predicts it above a tenth of the noise power."""
    first = set_filter(view, work, path.delay)
    first_of_pulse = sample(view.pulse, view.oversampling, path.delay, work.pulse)
    direction = toward(path.azimuth, path.elevation)
    for b in range(cir.shape[0]):
        removed[i, b] = 0
        noise = view.beams[b].noise
        if math.isnan(noise):
            continue
        predicted = path.amplitude * pattern(view, b, direction)[0]
        if predicted * predicted < 0.1 * noise and b != path.beam:
            continue
        amplitude = match(cir, b, first, work.matched)
        size = math.sqrt(power(amplitude))
        if size > view.margin_above * predicted and b != path.beam:
            amplitude = complex(amplitude.real * predicted / size, amplitude.imag * predicted / size)
        removed[i, b] = amplitude
        add(cir, b, first_of_pulse, work.pulse, -amplitude)
