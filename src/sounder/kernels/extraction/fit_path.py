"""Fit of one path: add it to the samples again, fit it, subtract it.

In the link of the departure beam ``t`` and the arrival beam ``b`` a path has the magnitude ``|c_tb| = a g_t g_b``, with
the patterns ``g_t(departure)`` and ``g_b(arrival)``. With those at the other end known, the least-squares magnitudes

``m_b = sum_t g_t |c_tb| / sum_t g_t^2 = a g_b``,  of variance ``s^2 / sum_t g_t^2``,

hold all that the links know of the arrival: the squares to be minimised are those about ``m_b``, times
``sum_t g_t^2``, and terms without ``b``. So the same fit serves both ends in turn, and ends at the common minimum. With
the amplitude eliminated, the slopes of the model are ``a (g_b' - g_b g.g'/g.g) g_t`` by the arrival and
``a g_b (g_t' - g_t g.g'/g.g)`` by the departure. These are orthogonal: the angles at one end have no correlation with
those at the other, and each fit's covariance is the Cramer-Rao bound of both. The amplitude's variance is
``s^2 / sum_tb (g_t g_b)^2`` and what the angles of either end add to it.
"""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.angle_search import (
    FINAL_STEPS,
    fit_near,
    list_neighbours,
    search_angles,
    weigh_beams,
)
from sounder.kernels.extraction.delay_fit import magnitude_variance, measure_magnitudes, refine_delay, set_filter
from sounder.kernels.extraction.pulse import Cir, add, match, power, power_around, sample
from sounder.kernels.extraction.records import ARRIVAL, DEPARTURE, Path, Paths
from sounder.kernels.extraction.scan_view import AntennaView, ScanView, beam_of, link_gain, pattern, toward, toward_path
from sounder.kernels.extraction.sidelobe_check import measure_sidelobes
from sounder.kernels.extraction.workspace import Workspace


@part
def update_path(cir: Cir, view: ScanView, work: Workspace, path: Paths, removed: Cir, i: int, removes: bool) -> None:
    """Add path ``i`` back to the links, fit it to the residual of the others and, if ``removes``, subtract it again.

    ``path`` (2,) and ``removed[i]`` hold the path; for a new one the link, a first delay, and zeros.
    """
    first = sample(view.pulse, view.oversampling, path[ARRIVAL].delay, work.pulse)
    for b in range(cir.shape[0]):
        if removed[i, b] != 0:
            add(cir, b, first, work.pulse, complex(removed[i, b]))  # in double precision, as `_remove` adds it
    _fit(cir, view, work, path)
    if removes:
        _remove(cir, view, work, path, removed, i)
        path[ARRIVAL].residual_power = power_around(cir, path[ARRIVAL].beam, path[ARRIVAL].delay)


@part
def _fit(cir: Cir, view: ScanView, work: Workspace, path: Paths) -> None:
    """Delay and angles from the link that a path was found in and its neighbours, each given the others.

    ``path`` holds the link and a first delay and, unless they are to be searched anew, the angles. With a phase of
    its own in every link, the likelihood is largest where ``sum_tb g_t g_b |c_tb(delay)|`` is, ``c_tb`` being the
    output of the matched filter.
    """
    arrival, departure = path[ARRIVAL], path[DEPARTURE]
    link, delay = arrival.beam, arrival.delay
    several_departures = view.departure.beams.size > 1
    if arrival.search_angles:
        _take_alone(view.arrival, work, link)
        _take_alone(view.departure, work, link)
        delay = refine_delay(cir, view, work, delay, 0.5)
        _search(cir, view, view.arrival, work, link, delay, arrival)
        if several_departures:
            _take_alone(view.arrival, work, link)
            _search(cir, view, view.departure, work, link, delay, departure)
    free = list_neighbours(link, view, view.arrival, work)
    free_departure = list_neighbours(link, view, view.departure, work)
    weigh_beams(view.arrival, work, arrival)
    weigh_beams(view.departure, work, departure)
    delay = refine_delay(cir, view, work, delay, 0.15)
    if several_departures:
        _fit_end(cir, view, view.departure, work, link, delay, free_departure, departure)
    of_departure = weigh_beams(view.departure, work, departure)
    _fit_end(cir, view, view.arrival, work, link, delay, free, arrival)
    arrival.delay = delay
    arrival.pattern_energy = weigh_beams(view.arrival, work, arrival) * of_departure
    arrival.beam_gain = link_gain(view, link, toward_path(path))
    if several_departures:
        own = magnitude_variance(view, link) / arrival.pattern_energy
        if departure.amplitude_variance > own:
            arrival.amplitude_variance += departure.amplitude_variance - own
        direction = toward(departure.azimuth, departure.elevation)
        departure.beam_gain = pattern(view.departure, beam_of(view.departure, link), direction)[0]


@part
def _take_alone(antenna: AntennaView, work: Workspace, link: int) -> None:
    """Take the beam of a link at one end, and no other there."""
    work.near[antenna.end, 0], work.near[antenna.end, 1] = beam_of(antenna, link), -1
    work.weight[antenna.end, 0] = 1.0


@part
def _search(
    cir: Cir, view: ScanView, antenna: AntennaView, work: Workspace, link: int, delay: float, path: Path
) -> None:
    """Search the direction at one end, in the links with the path's beam at the other end."""
    free = list_neighbours(link, view, antenna, work)
    measure_magnitudes(cir, view, antenna, work, delay)
    measure_sidelobes(cir, view, antenna, work, link, delay)
    search_angles(link, view, antenna, work, free, path)


@part
def _fit_end(
    cir: Cir,
    view: ScanView,
    antenna: AntennaView,
    work: Workspace,
    link: int,
    delay: float,
    free: tuple[float, float],
    path: Path,
) -> None:
    """Fit the direction and the amplitude at one end; the other directions that its beams do not exclude count too."""
    measure_magnitudes(cir, view, antenna, work, delay)
    fit_near(link, view, antenna, work, free, FINAL_STEPS, path)
    path.elevation_variance += path.elevation_spread * path.elevation_spread
    path.amplitude_variance += path.amplitude_spread * path.amplitude_spread
    path.elevation_amplitude += path.elevation_spread * path.amplitude_spread


@part
def _remove(cir: Cir, view: ScanView, work: Workspace, path: Paths, removed: Cir, i: int) -> None:
    """Subtract path ``i`` from every link in which the pattern predicts it above a tenth of the noise power."""
    arrival, directions = path[ARRIVAL], toward_path(path)
    first = set_filter(view, work, arrival.delay)
    first_of_pulse = sample(view.pulse, view.oversampling, arrival.delay, work.pulse)
    for b in range(cir.shape[0]):
        removed[i, b] = 0
        noise = view.links[b].noise
        if math.isnan(noise):
            continue
        predicted = arrival.amplitude * link_gain(view, b, directions)
        if predicted * predicted < 0.1 * noise and b != arrival.beam:
            continue
        amplitude = match(cir, b, first, work.matched)
        size = math.sqrt(power(amplitude))
        if size > view.margin_above * predicted and b != arrival.beam:
            amplitude = complex(amplitude.real * predicted / size, amplitude.imag * predicted / size)
        removed[i, b] = amplitude
        add(cir, b, first_of_pulse, work.pulse, -amplitude)
