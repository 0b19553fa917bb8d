"""Delay of a path, and its amplitudes in the links at that delay, by the matched filter."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.pulse import Cir, match, power, sample, times
from sounder.kernels.extraction.records import ARRIVAL, DEPARTURE, FIT_BEAMS
from sounder.kernels.extraction.scan_view import AntennaView, ScanView
from sounder.kernels.extraction.workspace import Workspace


@part
def set_filter(view: ScanView, work: Workspace, delay: float) -> int:
    """Fill ``work.matched`` so that it measures the amplitude of a path at ``delay``; return its first sample."""
    first = sample(view.matched, view.oversampling, delay, work.matched)
    sample(view.pulse, view.oversampling, delay, work.inner)
    energy = 0j
    for i in range(work.matched.size):
        energy += times(work.inner[i], work.matched[i])
    size = power(energy)
    scale = complex(energy.real / size, -energy.imag / size)
    for i in range(work.matched.size):
        work.matched[i] = times(work.matched[i], scale)
    return first


@part
def refine_delay(cir: Cir, view: ScanView, work: Workspace, delay: float, step: float) -> float:
    """Delay [sample] at which the weighted magnitudes are largest, within two steps or so.

    Parabolas through three points, over two steps: the sum is smooth and has one maximum over the main lobe.
    """
    for _ in range(2):
        before = _weighted_magnitude(cir, view, work, delay - step)
        here = _weighted_magnitude(cir, view, work, delay)
        after = _weighted_magnitude(cir, view, work, delay + step)
        move = 1.0 if after > before else -1.0
        curvature = before - 2 * here + after
        if curvature < 0.0 and abs(before - after) < -2 * curvature:
            move = 0.5 * (before - after) / curvature
        delay += step * move
        step *= 0.3
    return delay


@part
def _weighted_magnitude(cir: Cir, view: ScanView, work: Workspace, delay: float) -> float:
    first = set_filter(view, work, delay)
    total = 0.0
    for j in range(FIT_BEAMS):
        if work.near[DEPARTURE, j] < 0:
            break
        for i in range(FIT_BEAMS):
            if work.near[ARRIVAL, i] < 0:
                break
            link = work.near[DEPARTURE, j] * view.departure.stride + work.near[ARRIVAL, i] * view.arrival.stride
            if not math.isnan(view.links[link].noise):
                weight = work.weight[DEPARTURE, j] * work.weight[ARRIVAL, i]
                total += weight * math.sqrt(power(match(cir, link, first, work.matched)))
    return total


@part
def measure_magnitudes(cir: Cir, view: ScanView, antenna: AntennaView, work: Workspace, delay: float) -> None:
    """Magnitudes of the path in the beams of the fit at one end, without what noise adds to them on average.

    With ``|c_bt| = a g_b g_t``, and the pattern ``g_t`` at the other end known, that of a beam is the least-squares
    ``m_b = sum_t g_t |c_bt| / sum_t g_t^2``.
    """
    first = set_filter(view, work, delay)
    other = 1 - antenna.end
    stride = view.departure.stride if other == DEPARTURE else view.arrival.stride
    for i in range(FIT_BEAMS):
        if work.near[antenna.end, i] < 0:
            break
        total = energy = 0.0
        for j in range(FIT_BEAMS):
            if work.near[other, j] < 0:
                break
            link = work.near[antenna.end, i] * antenna.stride + work.near[other, j] * stride
            if not math.isnan(view.links[link].noise):
                square = power(match(cir, link, first, work.matched)) - magnitude_variance(view, link)
                weight = work.weight[other, j]
                total += weight * (math.sqrt(square) if square > 0.0 else 0.0)
                energy += weight * weight
        work.magnitude[i] = total / energy


@part
def magnitude_variance(view: ScanView, link: int) -> float:
    """Variance of a path's magnitude in a link."""
    return 0.5 * view.amplitude_variance * view.links[link].noise


@part
def combined_variance(view: ScanView, antenna: AntennaView, work: Workspace, link: int) -> float:
    """Variance of the magnitudes at one end: that in a link over the sum of the squared pattern at the other end."""
    energy = 0.0
    for j in range(FIT_BEAMS):
        if work.near[1 - antenna.end, j] < 0:
            break
        weight = work.weight[1 - antenna.end, j]
        energy += weight * weight
    return magnitude_variance(view, link) / energy
