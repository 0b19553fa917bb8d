"""Derivatives of the pattern by the direction of a path are those of the pattern."""

import numpy as np

from sounder.instrument.antenna_pattern import ANGLE_STEP, Pattern
from sounder.mpc.directions import beam_directions
from sounder.mpc.pattern_slopes import Cuts, slopes


def test_slopes_are_those_of_the_pattern(bench):
    """Against differences over one step of the cuts, which are linear in decibels from point to point.

    A difference over two steps is the mean of two slopes, the table's one between means of two: at a turn of the cut
    they differ by half of what the slope changes in a step. In the frame of the antenna angles turn at most as fast as
    azimuth does, and the product with the amplitude is the change of the amplitude's own slope.
    """
    pattern, rng = Pattern.of(bench.sounder.rx_antenna), np.random.default_rng(7)
    azimuth, elevation = rng.uniform(0, 360, (40, 2)), rng.uniform(-13, 13, (40, 2))
    directions = beam_directions(bench.sounder.scan.azimuth, bench.sounder.scan.elevation)

    def level(east, up):
        return pattern.beam_gain(azimuth[..., None] + east, elevation[..., None] + up, *directions.T) * np.log(10) / 20

    g, turned, raised = slopes(azimuth, elevation, directions, Cuts.of(pattern))
    np.testing.assert_allclose(g, np.exp(level(0, 0)), rtol=1e-9)
    curve = max(np.abs(np.diff(cut, 2)).max() for cut in (pattern.azimuth_cut, pattern.elevation_cut))
    for made, (east, up) in ((turned, (ANGLE_STEP, 0)), (raised, (0, ANGLE_STEP))):
        difference = (level(east, up) - level(-east, -up)) / (2 * ANGLE_STEP)
        above = np.exp(np.minimum(level(east, up), level(-east, -up))) > 10 ** (pattern.floor / 20)  # no kink between
        assert np.abs(made - g * difference)[above].max() < 0.5 * curve * np.log(10) / 20 / ANGLE_STEP
