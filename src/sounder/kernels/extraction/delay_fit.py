"""Delay of a path, and its amplitudes in the beams at that delay, by the matched filter."""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.columns import NEAR, Beams, Work
from sounder.kernels.extraction.pulse import match, power, sample, times
from sounder.kernels.extraction.scan_view import NOISE, OVER, SPREAD, View


@part
def tune(view: View, work: Work, delay: float) -> int:
    """Fill ``work.matched`` so that it measures the amplitude of a path at ``delay``; return its first sample."""
    over = view.grid[OVER]
    first = sample(view.matched, over, delay, work.matched)
    sample(view.pulse, over, delay, work.inner)
    energy = 0j
    for i in range(work.matched.size):
        energy += times(work.inner[i], work.matched[i])
    size = power(energy)
    scale = complex(energy.real / size, -energy.imag / size)
    for i in range(work.matched.size):
        work.matched[i] = times(work.matched[i], scale)
    return first


@part
def climb(beams: Beams, view: View, work: Work, delay: float, step: float) -> float:
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
    first = tune(view, work, delay)
    total = 0.0
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        total += work.weight[i] * math.sqrt(power(match(beams, work.near[i], first, work.matched)))
    return total


@part
def measure(beams: Beams, view: View, work: Work, delay: float) -> None:
    """Magnitude of the path in each beam of the fit; what noise adds to it on average is taken off."""
    first = tune(view, work, delay)
    for i in range(NEAR):
        if work.near[i] < 0:
            break
        left = power(match(beams, work.near[i], first, work.matched)) - magnitude_variance(view, work.near[i])
        work.magnitude[i] = math.sqrt(left) if left > 0.0 else 0.0


@part
def magnitude_variance(view: View, b: int) -> float:
    """Variance of a path's magnitude in a beam."""
    return 0.5 * view.limits[SPREAD] * view.beam[b, NOISE]
