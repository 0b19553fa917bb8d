"""Direction of a path in the beams around it, searched from several starts at the edge of the fan."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.beam_fit import fit_angles
from sounder.kernels.extraction.delay_fit import combined_variance, magnitude_variance
from sounder.kernels.extraction.records import FIT_BEAMS, Path
from sounder.kernels.extraction.scan_view import AntennaView, ScanView, beam_of, pattern, toward, with_beam
from sounder.kernels.extraction.sidelobe_check import sidelobe_misfit
from sounder.kernels.extraction.workspace import TRIALS, Workspace

EXCLUDING_MISFIT = 9.0
"""Sidelobe misfit that excludes a direction: 3 standard deviations."""
ALTERNATIVE_MISFIT = 6.0
"""Squared residuals, in variances, by which another direction is 20 times less likely (``2 ln 20``). It is then no
longer an error of the one chosen."""
STRENGTH_PRIOR = 4.0 / math.log(10.0)
"""The same by which a path e times as strong is less likely beforehand: of every 10 dB more there are e times fewer."""
MIN_SIDELOBE_EVIDENCE = 4.0
"""Decrease of the sidelobe misfit from which on the far beams may decide for another direction: 2 standard
deviations."""
MAX_RESIDUAL_RATIO = 0.25
"""Squared residuals of a fit outside the fan, relative to those of the best inside, under which it wins; chosen."""
TRIAL_STEPS = 8.0
"""Steps of a fit from one of several starts, at most."""
FINAL_STEPS = 20.0
"""Steps of the last fit, at most."""


@part
def search_angles(
    link: int, view: ScanView, antenna: AntennaView, work: Workspace, free: tuple[float, float], path: Path
) -> None:
    """Fit the angles; at the edge of the fan from several directions.

    Fills ``path`` with the best direction, the bounds of its fit, and the spread of those not excluded. Beyond the edge
    of the fan the pattern's floor makes further minima: start from several angles, the beam's own first, and that one
    kept within half its power.
    """
    b = beam_of(antenna, link)
    azimuth, elevation = antenna.beams[b].azimuth, antenna.beams[b].elevation
    row_of_scan = b % antenna.elevations
    top = row_of_scan == antenna.elevations - 1
    outward = 1.0 if top else -1.0
    trials = TRIALS if free[1] > 0.0 and (top or row_of_scan == 0) else 1
    edge = elevation + 0.5 * outward * antenna.beamwidth
    for number in range(trials):
        tilt, turn = (number + 2) // 3, number % 3 - 1 if number else 0
        path.azimuth = azimuth + 0.4 * turn * antenna.azimuth_reach
        up = elevation + 0.5 * outward * tilt * antenna.beamwidth
        path.elevation = antenna.lowest if up < antenna.lowest else antenna.highest if up > antenna.highest else up
        _bound(number == 0 and trials > 1, outward, edge, antenna, path)
        trial = work.trials[number]
        trial.squares = fit_near(link, view, antenna, work, free, TRIAL_STEPS, path)
        trial.azimuth, trial.elevation, trial.amplitude = path.azimuth, path.elevation, path.amplitude
        trial.sidelobe_misfit = sidelobe_misfit(view, antenna, work, link, path) if trials > 1 else 0.0
    best = _choose(link, view, antenna, work, trials, outward, edge, path)
    path.azimuth, path.elevation = work.trials[best].azimuth, work.trials[best].elevation
    _bound(best == 0 and trials > 1, outward, edge, antenna, path)


@part
def _bound(within_fan: bool, outward: float, edge: float, antenna: AntennaView, path: Path) -> None:
    """Set the elevations between which a path is fitted."""
    path.lowest_elevation = edge if within_fan and outward < 0 else antenna.lowest
    path.highest_elevation = edge if within_fan and outward > 0 else antenna.highest


@part
def fit_near(
    link: int,
    view: ScanView,
    antenna: AntennaView,
    work: Workspace,
    free: tuple[float, float],
    max_steps: float,
    path: Path,
) -> float:
    """Fit the angles at one end to its magnitudes about a link, within the bounds of the path; see `fit_angles`."""
    azimuth = antenna.beams[beam_of(antenna, link)].azimuth
    bounds = (
        azimuth - antenna.azimuth_reach,
        azimuth + antenna.azimuth_reach,
        path.lowest_elevation,
        path.highest_elevation,
    )
    variance = combined_variance(view, antenna, work, link)
    return fit_angles(antenna, work.magnitude, work.near[antenna.end], variance, bounds, free, max_steps, path)


@part
def _choose(
    link: int,
    view: ScanView,
    antenna: AntennaView,
    work: Workspace,
    trials: int,
    outward: float,
    edge: float,
    path: Path,
) -> int:
    """Choose among the directions tried; the spread of those not excluded is kept in ``path``.

    A direction beyond the half-power edge of the beam must fit clearly better than the best one within, so that neither
    interference nor noise turns a weak path into a strong one outside. Or the far beams must support it.

    Clearly better means a quarter of the squared residuals (`MAX_RESIDUAL_RATIO`), and less by one noise power over the
    pattern's amplitude in that direction. Just above the fan that is 2 to 3 standard deviations of the magnitudes; far
    out, where a path must be 20 dB stronger than it looks, 10.
    """
    tried, inside, best = work.trials, 0, -1
    noise = view.links[link].noise
    for i in range(1, trials):
        out = outward * tried[i].elevation
        if out <= outward * edge and tried[i].squares < tried[inside].squares:
            nearer = out <= outward * tried[0].elevation
            if nearer or tried[i].squares < tried[inside].squares - noise / _pattern_toward(link, antenna, work, i):
                inside = i
    variance = _variance(view, antenna, work, link, tried[inside].squares)
    at_most = tried[inside].sidelobe_misfit if tried[inside].sidelobe_misfit < EXCLUDING_MISFIT else EXCLUDING_MISFIT
    for i in range(1, trials):
        squares, evidence = tried[i].squares, at_most - tried[i].sidelobe_misfit
        if outward * tried[i].elevation <= outward * edge or evidence < -EXCLUDING_MISFIT:
            continue
        fits = squares < MAX_RESIDUAL_RATIO * tried[inside].squares
        fits = fits and squares < tried[inside].squares - noise / _pattern_toward(link, antenna, work, i)
        supported = evidence > MIN_SIDELOBE_EVIDENCE and squares < tried[inside].squares + variance * evidence
        if (supported or fits) and (best < 0 or _total(work, i, variance) < _total(work, best, variance)):
            best = i
    if best < 0:
        best = inside
    variance = _variance(view, antenna, work, link, tried[best].squares)
    most = _total(work, best, variance) + ALTERNATIVE_MISFIT * variance
    elevation_spread = amplitude_spread = 0.0
    for i in range(trials):
        ratio = math.log(tried[i].amplitude / tried[best].amplitude)
        if _total(work, i, variance) + STRENGTH_PRIOR * ratio * variance < most:
            further = tried[i].elevation - tried[best].elevation
            stronger = tried[best].amplitude * ratio
            if abs(further) > abs(elevation_spread):
                elevation_spread = further
            if abs(stronger) > abs(amplitude_spread):
                amplitude_spread = stronger
    path.elevation_spread, path.amplitude_spread = elevation_spread, amplitude_spread
    return best


@part
def _total(work: Workspace, number: int, variance: float) -> float:
    """Squared residuals of a direction tried in the beams about it, and in those far from it."""
    return work.trials[number].squares + variance * work.trials[number].sidelobe_misfit


@part
def _pattern_toward(link: int, antenna: AntennaView, work: Workspace, number: int) -> float:
    """Amplitude of a beam's pattern toward a direction tried."""
    return pattern(antenna, beam_of(antenna, link), toward(work.trials[number].azimuth, work.trials[number].elevation))[
        0
    ]


@part
def _variance(view: ScanView, antenna: AntennaView, work: Workspace, link: int, squares: float) -> float:
    """Variance of the magnitudes: the larger of that of the noise and the mean squared residual."""
    freedom = -3.0
    for i in range(FIT_BEAMS):
        if work.near[antenna.end, i] < 0:
            break
        freedom += 1.0
    variance = magnitude_variance(view, link)
    return squares / freedom if freedom > 0.0 and squares / freedom > variance else variance


@part
def list_neighbours(link: int, view: ScanView, antenna: AntennaView, work: Workspace) -> tuple[float, float]:
    """List the beam of a link at one end, and those around it that were recorded with the beam at the other end.

    Returns 1 for each angle that they determine, else 0.
    """
    b, near = beam_of(antenna, link), work.near[antenna.end]
    a, e = b // antenna.elevations, b % antenna.elevations
    count = 0
    free_azimuth = free_elevation = 0.0
    for da in range(-1, 2):
        for de in range(-1, 2):
            na, ne = a + da, e + de
            if antenna.full_circle:
                na = na % antenna.azimuths
            if na < 0 or na >= antenna.azimuths or ne < 0 or ne >= antenna.elevations:
                continue
            if antenna.azimuths < 3 and da == 1 and antenna.full_circle:
                continue  # the same beam as da == -1
            other = na * antenna.elevations + ne
            if math.isnan(view.links[with_beam(antenna, link, other)].noise):
                continue
            near[count] = other
            count += 1
            if da != 0:
                free_azimuth = 1.0
            if de != 0:
                free_elevation = 1.0
    near[count] = -1
    return free_azimuth, free_elevation


@part
def weigh_beams(antenna: AntennaView, work: Workspace, path: Path) -> float:
    """Weigh the beams of the fit at one end with their patterns toward a path; return the sum of squares."""
    direction = toward(path.azimuth, path.elevation)
    energy = 0.0
    for i in range(FIT_BEAMS):
        if work.near[antenna.end, i] < 0:
            break
        weight = pattern(antenna, work.near[antenna.end, i], direction)[0]
        work.weight[antenna.end, i] = weight
        energy += weight * weight
    return energy
