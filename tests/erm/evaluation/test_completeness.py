"""What receivers see of an outline, against shadows that a ruler gives."""

import numpy as np
import pytest

from erm.evaluation.completeness import completeness, count_receivers
from erm.maps.environment import Environment

FAR = np.array([[0.0, 10.0], [100.0, 10.0]])
SCREEN = np.array([[40.0, 5.0], [60.0, 5.0]])
OUTLINE = np.array([FAR, SCREEN])


def test_the_shadow_of_a_screen_is_what_geometry_makes_it():
    # from (50, 0), a screen of 20 m half-way to the wall shades 40 m of it
    seen = count_receivers(FAR, OUTLINE, [[50.0, 0.0]])
    assert len(seen) == 200
    assert np.sum(seen == 0) == 80
    assert seen[:60].all()
    assert not seen[60:140].any()
    assert seen[140:].all()


def test_a_receiver_behind_the_wall_sees_all_of_it_and_one_inside_a_box_nothing_else():
    assert count_receivers(FAR, OUTLINE, [[50.0, 20.0], [50.0, 0.0]]).tolist().count(1) == 80
    box = np.array([[[0, 0], [1, 0]], [[1, 0], [1, 1]], [[1, 1], [0, 1]], [[0, 1], [0, 0]]], dtype=float)
    assert not count_receivers(FAR, np.concatenate([OUTLINE, box]), [[0.5, 0.5]]).any()


def test_completeness_counts_what_enough_receivers_see():
    # the map has the wall's right half, 0.2 m off; of the 40 m in the shadow of both, 20 m are mapped
    here = Environment.walls([[[50, 10.2], [100, 10.2]]])
    receivers = [[50.0, 0.0, 1.4], [50.0, 0.0001, 1.4]]
    one, two, three = completeness(here, OUTLINE, receivers, min_receivers=(1, 2, 3))
    assert one.length == pytest.approx(60 + 20)  # the wall but its shade, and the screen
    assert one.share == pytest.approx(30 / 80)
    assert two == (2, one.length, one.share)
    assert three.length == 0
    assert np.isnan(three.share)


def test_it_does_not_depend_on_the_frame():
    rng = np.random.default_rng(8)
    angle, shift = rng.uniform(0, 6), rng.uniform(-99, 99, 2)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    wall, receivers = np.array([[[20.1, 10.0], [70.1, 10.0]]]), rng.uniform([0, -20], [100, 4], (6, 2))
    here = completeness(Environment.walls(wall), OUTLINE, receivers)
    there = completeness(Environment.walls(wall @ turn + shift), OUTLINE @ turn + shift, receivers @ turn + shift)
    np.testing.assert_allclose(there, here, rtol=1e-9)
