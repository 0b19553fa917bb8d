"""What the beams far from a path say of its direction: how strong it is, by what of it their sidelobes let in.

A path beyond the edge of the fan is seen by the main lobe of no beam. The few beams around it cannot tell whether it is
weak and near the fan or strong and far from it; but a strong one enters through the sidelobes of all beams. Sidelobes
are known to some decibels only, and other paths may arrive at about the same delay in some beams. So the far beams
judge together, none of them counts for much, and the margins are wide.
"""

import math

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.beam_fit import AMPLITUDE, AZIMUTH, ELEVATION
from sounder.kernels.extraction.columns import Beams, Work
from sounder.kernels.extraction.delay_fit import tune
from sounder.kernels.extraction.pulse import match, power
from sounder.kernels.extraction.scan_view import LOOK_AZIMUTH, NOISE, REACH, SPREAD, View, aim, pattern

FAR = 4.0
"""How far from the beam of the path the far beams begin, in units of what a path may be from its beam in azimuth."""
ABOVE = 4.0
"""Power over the pattern's prediction that is still the same path's (6 dB, for horns not as measured)."""
BELOW = 16.0
"""The same under it (12 dB: a described floor may be a limit, and the real one lower)."""
VAGUE = 0.35
"""Standard deviation of these margins themselves, relative: 1.3 dB."""
MOST = 3.0
"""Power over that, in noise powers, that a beam may contribute: other paths are in few beams."""
BESIDE = 5
"""How much earlier and later the far beams are heard for comparison [sample]; the pulse is under -31 dB there."""
DEVIATION = 1.02
"""Standard deviation of a beam's power, clipped at `MOST`, less the mean of the two beside it [noise power]."""


@part
def listen(beams: Beams, view: View, work: Work, found_in: int, delay: float) -> None:
    """Fill ``work.far`` with the power at a delay, and beside it, in every beam; -1 in those near or not recorded.

    Powers are in those of the noise.
    """
    for side in range(3):
        first = tune(view, work, delay + (side - 1) * BESIDE)
        for b in range(beams.shape[0]):
            heard = power(match(beams, b, first, work.matched)) / (view.limits[SPREAD] * view.beam[b, NOISE])
            work.far[b, side] = heard if heard >= 0.0 else -1.0
    for b in range(beams.shape[0]):
        aside = abs(view.beam[b, LOOK_AZIMUTH] - view.beam[found_in, LOOK_AZIMUTH]) % 360.0
        if aside <= FAR * view.limits[REACH] or 360.0 - aside <= FAR * view.limits[REACH]:
            work.far[b, 1] = -1.0


@part
def judge(view: View, work: Work) -> float:
    """Squared deviation, in variances, of what the far beams hold from what the path of ``work.fit`` allows there."""
    aim(work.fit[AZIMUTH], work.fit[ELEVATION], work.direction)
    count = 0
    held = beside = noise = expected = 0.0
    for b in range(work.far.shape[0]):
        heard, before, after = work.far[b, 1], work.far[b, 0], work.far[b, 2]
        if heard < 0.0:
            continue
        amplitude = work.fit[AMPLITUDE] * pattern(view, work.direction, b, work.slopes)
        own = amplitude * amplitude / (view.limits[SPREAD] * view.beam[b, NOISE])
        most = MOST + ABOVE * own
        count += 1
        held += heard if heard < most else most
        beside += 0.5 * ((before if before < most else most) + (after if after < most else most))
        noise += 1.0 - math.exp(-most)
        expected += own
    excess = held - (beside if beside > noise else noise)
    allowed = ABOVE * expected if excess > expected else expected / BELOW
    if (excess - expected) * (excess - allowed) <= 0.0:
        return 0.0
    beyond, vague = excess - allowed, VAGUE * allowed
    return beyond * beyond / (DEVIATION * DEVIATION * count + vague * vague)
