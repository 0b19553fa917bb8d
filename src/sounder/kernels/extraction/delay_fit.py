"""Delay of a path, and its amplitudes in the beams at that delay, by the matched filter."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.pulse import Cir, match, power, sample, times
from sounder.kernels.extraction.records import FIT_BEAMS
from sounder.kernels.extraction.scan_view import ScanView
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
    for i in range(FIT_BEAMS):
        if work.near[i] < 0:
            break
        total += work.weight[i] * math.sqrt(power(match(cir, work.near[i], first, work.matched)))
    return total


@part
def measure_magnitudes(cir: Cir, view: ScanView, work: Workspace, delay: float) -> None:
    """Magnitude of the path in each beam of the fit, without what noise adds to it on average."""
    first = set_filter(view, work, delay)
    for i in range(FIT_BEAMS):
        if work.near[i] < 0:
            break
        square = power(match(cir, work.near[i], first, work.matched)) - magnitude_variance(view, work.near[i])
        work.magnitude[i] = math.sqrt(square) if square > 0.0 else 0.0


@part
def magnitude_variance(view: ScanView, b: int) -> float:
    """Variance of a path's magnitude in a beam."""
    return 0.5 * view.amplitude_variance * view.beams[b].noise
