"""A map predicts what it holds: the true one everything, an empty one nothing."""

from dataclasses import replace

import numpy as np
import pytest

from erm.letter.captures import Campaign, Link
from erm.letter.prediction import (
    MIN_POWER,
    choose_positions,
    cut_back,
    evaluate_prediction,
    predict,
    shifted_route,
)
from erm.letter.sweeps import along
from erm.letter.truth import as_table, rays_of
from erm.maps.environment import Environment

TX = (0.0, 0.0, 10.0)


@pytest.fixture(scope="module")
def street() -> Campaign:
    place = Environment.walls([[[-20, 20], [90, 20]], [[90, -15], [-20, -15]]])
    links = tuple(Link(f"RX{i}", TX, (20.0 + 5 * i, 2.0, 2.0)) for i in range(9))
    return Campaign("street", place, links, 132e9, 2, {}, None)


def test_the_true_map_predicts_the_whole_channel(street):
    found = evaluate_prediction(street.environment, shifted_route(street))
    assert (found.power, found.false, found.level) == pytest.approx((1.0, 0.0, 0.0))


def test_an_empty_map_predicts_nothing(street):
    found = evaluate_prediction(Environment.empty(), shifted_route(street))
    assert (found.power, found.false, found.level) == pytest.approx((0.0, 0.0, -10 * np.log10(MIN_POWER)))


@pytest.mark.slow
def test_more_positions_predict_more(street):
    # two positions cannot confirm a wall, nine see both sides of the street at all of their reflection points
    few, many = predict(as_table(street, rays_of(street)), street, shifted_route(street), counts=(2, 9), replicates=2)
    assert few.of("walls").tolist() == [0, 0]
    assert (many.positions, len(many.replicates)) == (9, 1)
    assert many.of("power").min() > 0.5
    assert many.of("level").max() < few.of("level").min()


def test_choices_are_spread_over_all_positions_and_repeat_themselves():
    chosen = choose_positions(24, 4, 3)
    assert chosen == choose_positions(24, 4, 3)
    assert chosen[0] == [0, 8, 15, 23]
    assert all([i // 6 for i in one] == [0, 1, 2, 3] for one in chosen)
    assert choose_positions(5, 9, 3) == [[0, 1, 2, 3, 4]]


@pytest.mark.slow
def test_a_wall_over_an_opening_predicts_falsely_until_it_is_cut_back(street):
    # in truth the northern face hangs over a passage between east 20 and 60, from 8 m up
    south = [[90, -15], [-20, -15]]
    faces = [[[-20, 20], [20, 20]], [[20, 20], [60, 20]], [[60, 20], [90, 20]], south]
    true = replace(street, environment=Environment.walls(faces, base=[0.0, 8.0, 0.0, 0.0], top=20.0))
    found = evaluate_prediction(Environment.walls([[[-20, 20], [90, 20]], south], top=20.0), shifted_route(true))
    assert found.false > 0.1
    assert found.false_cut < 0.01


def test_poles_stay_when_walls_are_cut_back():
    place = Environment.walls([[[0, 0], [10, 0]]]).with_poles([[5.0, 5.0]], 0.1)
    cut = cut_back(place, np.array([[[0.0, 0.0], [4.0, 0.0]], [[8.0, 0.0], [10.0, 0.0]]]))
    assert cut.reflectors["kind"].values.tolist() == ["wall", "wall", "pole"]
    # to the spacing of the points by which walls are cut, and the reach of a face
    np.testing.assert_allclose(cut.reflectors["end_points"].values[:2, :, 0], [[0, 4.3], [7.7, 10]], atol=0.15)


def test_positions_along_a_line_keep_their_spacing_and_ends(street):
    moved = along(street, 10.0, [("RX0", "RX8")])
    east = [link.rx[0] for link in moved.links]
    assert east == pytest.approx([20.0, 30.0, 40.0, 50.0, 60.0])
    assert {link.tx for link in moved.links} == {TX}


def test_sparser_positions_of_a_replicate_are_among_its_denser_ones(street):
    for offset in (0.0, 6.0, 13.0):
        dense, sparse = (set(along(street, s, [("RX0", "RX8")], offset=offset).links) for s in (2.5, 20.0))
        assert sparse <= dense
