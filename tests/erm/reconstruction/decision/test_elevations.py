"""Elevations of a candidate: two strays say nothing, a mean of all paths off the vertical says that it is no wall."""

from dataclasses import replace

import numpy as np
import pytest
from tests.erm.reconstruction.bounces import bounces, paths_of

from erm.reconstruction.decision.decide import _log_odds_of_elevation
from erm.reconstruction.model.line import Line
from erm.reconstruction.model.wall import Wall


def log_odds(excess, std):
    excess = np.array(excess, dtype=float)
    tx = np.tile([0.0, 0.0, 3.0], (len(excess), 1))
    rx = np.column_stack([np.arange(2.0, 2 + len(excess)), np.zeros(len(excess)), np.full(len(excess), 1.5)])
    paths = replace(
        paths_of(bounces(tx, rx, (270.0, -10.0))), elevation_excess=excess, elevation_std=np.full(len(excess), std)
    )
    return _log_odds_of_elevation(
        Wall(paths, Line(270.0, -10.0, np.eye(2), np.array([10.0, 10.0])), np.arange(len(excess)))
    )


def test_strays_do_not_deny_a_wall_and_a_common_mean_does():
    assert log_odds([0.1, -0.2, 0.1], 0.3) == pytest.approx(0.0, abs=0.1)
    assert log_odds([np.nan, np.nan, np.nan], 0.3) == 0.0
    assert log_odds([0.1, -0.2, 0.1, -5.0, 7.0], 0.3) > -0.5
    assert log_odds([10.1, 9.8, 10.1], 0.3) < -7
    # what is common to all within the tolerance of a map is no evidence, however many there are
    assert log_odds([0.5] * 30, 0.3) > -0.5


def test_means_within_their_errors_cost_what_their_deviation_is_worth():
    assert log_odds([10.0] * 3, 10.0) == pytest.approx(-1.5, abs=0.15)  # three of one standard deviation
