"""Openings of walls: a link that a pillar hides a wall from does not show one, and pillars hide walls that are none."""

import numpy as np
import pytest
import shapely
from tests.erm.reconstruction.bounces import bounces, paths_of

from erm.reconstruction.decision.decide import _openings_of_curved
from erm.reconstruction.decision.pieces import Links, cut_walls
from erm.reconstruction.model.extent import Legs
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import Line
from erm.reconstruction.model.wall import Wall

NOTHING = np.array([], dtype=object)


@pytest.fixture
def facade() -> tuple[Wall, Links]:
    """Links along a facade ten metres north; those that it would reflect between 8 and 14 m received nothing."""
    place = np.array([2.0, 4.0, 6.0, 8.0, 14.0, 16.0, 18.0, 9.5, 11.0, 12.5])
    rx = np.column_stack([2 * place, np.zeros(10), np.full(10, 1.5)])
    tx = np.tile([0.0, 0.0, 3.0], (10, 1))
    paths = paths_of(bounces(tx[:7], rx[:7], (270.0, -10.0)))
    line = fit_line(paths, Line(270.0, -10.0, np.eye(2), np.array([10.0, 10.0])))
    return Wall(paths, line, np.arange(7)), Links(tx, rx)


def test_a_pillar_explains_what_links_missed(facade):
    wall, links = facade
    legs = Legs(np.empty((0, 3)), np.empty((0, 3)))

    def pieces(curved: np.ndarray) -> int:
        return len(cut_walls([wall], legs, links, 15.0, curved)[0])

    assert pieces(NOTHING) == 2
    # the ways from the transmitter to 9.5, 11 and 12.5 m pass it, those to 8 and 14 m do not
    in_front = shapely.buffer(shapely.points([5.5, 5.0]), 0.6)
    assert pieces(np.array([in_front])) == 1
    assert pieces(np.array([shapely.buffer(shapely.points([1.0, 8.0]), 0.6)])) == 2


def test_a_wall_behind_a_curved_face_needs_an_opening(facade):
    wall, _ = facade
    arc = shapely.linestrings([[0.0, 5.0], [20.0, 5.0]])
    assert _openings_of_curved(wall, shapely.STRtree(np.array([arc]))) == 1
    beside = shapely.linestrings([[0.0, 11.0], [20.0, 11.0]])
    assert _openings_of_curved(wall, shapely.STRtree(np.array([beside]))) == 0
    assert _openings_of_curved(wall, shapely.STRtree(NOTHING)) == 0
