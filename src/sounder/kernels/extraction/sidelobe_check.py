"""The direction of a path, checked in the beams far from it: a strong path enters through their sidelobes.

A path beyond the edge of the fan is in the main lobe of no beam. To the few beams around it, a weak path near the fan
and a strong one far from it look alike; but a strong one enters all beams through their sidelobes. Sidelobes are known
to some decibels only, and other paths may arrive at about the same delay in some beams. So the far beams are summed,
the power of each is clipped, and the margins are wide.
"""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.delay_fit import set_filter
from sounder.kernels.extraction.pulse import Cir, match, power
from sounder.kernels.extraction.records import Path
from sounder.kernels.extraction.scan_view import AntennaView, ScanView, beam_of, pattern, toward, with_beam
from sounder.kernels.extraction.workspace import Workspace

FAR_BEAM_DISTANCE = 4.0
"""How far from the path's beam the far beams begin, in units of ``azimuth_reach``; chosen, not derived."""
MARGIN_ERROR = 0.35
"""Standard deviation of the margins of the pattern, relative: 1.3 dB; chosen, not derived."""
CLIP_LEVEL = 3.0
"""Power beyond what the path may have, in noise powers, that a beam may contribute: other paths are in few beams."""
COMPARISON_OFFSET = 5
"""How much earlier and later the power is taken for comparison [sample]; the pulse is under -31 dB there."""
CLIPPED_STD = 1.02
"""Standard deviation of a beam's power, clipped at `CLIP_LEVEL`, less the mean of the two beside it [noise power]."""


@part
def measure_sidelobes(
    cir: Cir, view: ScanView, antenna: AntennaView, work: Workspace, found_in: int, delay: float
) -> None:
    """Fill ``work.sidelobes`` with the power at a delay, and beside it, in every beam of an antenna far from its own.

    Powers are those with the beam at the other end of the link ``found_in``, in those of the noise; -1 in the other
    beams.
    """
    for side in range(3):
        first = set_filter(view, work, delay + (side - 1) * COMPARISON_OFFSET)
        for b in range(antenna.beams.size):
            link = with_beam(antenna, found_in, b)
            relative = power(match(cir, link, first, work.matched)) / (view.amplitude_variance * view.links[link].noise)
            work.sidelobes[b, side] = relative if relative >= 0.0 else -1.0
    own, near = antenna.beams[beam_of(antenna, found_in)].azimuth, FAR_BEAM_DISTANCE * antenna.azimuth_reach
    for b in range(antenna.beams.size):
        aside = abs(antenna.beams[b].azimuth - own) % 360.0
        if aside <= near or 360.0 - aside <= near:
            work.sidelobes[b, 1] = -1.0


@part
def sidelobe_misfit(view: ScanView, antenna: AntennaView, work: Workspace, found_in: int, path: Path) -> float:
    """Squared deviation, in variances, of the power in the far beams from what the path allows there."""
    direction = toward(path.azimuth, path.elevation)
    above, below = view.margin_above * view.margin_above, view.margin_below * view.margin_below
    count = 0
    held = beside = noise = expected = 0.0
    for b in range(antenna.beams.size):
        before, at, after = work.sidelobes[b, 0], work.sidelobes[b, 1], work.sidelobes[b, 2]
        if at < 0.0:
            continue
        g, _, _ = pattern(antenna, b, direction)
        amplitude = path.amplitude * g
        noise_power = view.links[with_beam(antenna, found_in, b)].noise
        own = amplitude * amplitude / (view.amplitude_variance * noise_power)
        most = CLIP_LEVEL + above * own
        count += 1
        held += at if at < most else most
        beside += 0.5 * ((before if before < most else most) + (after if after < most else most))
        noise += 1.0 - math.exp(-most)
        expected += own
    excess = held - (beside if beside > noise else noise)
    allowed = above * expected if excess > expected else expected / below
    if (excess - expected) * (excess - allowed) <= 0.0:
        return 0.0
    beyond, margin_std = excess - allowed, MARGIN_ERROR * allowed
    return beyond * beyond / (CLIPPED_STD * CLIPPED_STD * count + margin_std * margin_std)
