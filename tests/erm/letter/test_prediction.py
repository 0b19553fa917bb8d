"""A map predicts what it holds: the true one everything, an empty one nothing."""

import numpy as np
import pytest

from erm.environment import Environment
from erm.letter.captures import Campaign, Link
from erm.letter.prediction import LEAST, beside, judge, predict
from erm.letter.sweeps import along
from erm.letter.truth import as_table, rays_of

TX = (0.0, 0.0, 10.0)


@pytest.fixture(scope="module")
def street() -> Campaign:
    place = Environment.walls([[[-20, 20], [90, 20]], [[90, -15], [-20, -15]]])
    links = tuple(Link(f"RX{i}", TX, (20.0 + 5 * i, 2.0, 2.0)) for i in range(9))
    return Campaign("street", place, links, 132e9, 2, {}, None)


def test_the_true_map_predicts_the_whole_channel(street):
    found = judge(street.environment, beside(street), 9)
    assert (found.power, found.false, found.level) == pytest.approx((1.0, 0.0, 0.0))


def test_an_empty_map_predicts_nothing(street):
    found = judge(Environment.empty(), beside(street), 0)
    assert (found.power, found.false, found.level) == pytest.approx((0.0, 0.0, -10 * np.log10(LEAST)))


def test_more_positions_predict_more(street):
    # two positions cannot confirm a wall, nine see both sides of the street at all of their reflection points
    few, many = predict(as_table(street, rays_of(street)), street, beside(street), counts=(2, 9))
    assert few.walls == 0
    assert many.positions == 9
    assert many.power > 0.5
    assert many.level < few.level


def test_positions_along_a_line_keep_their_spacing_and_ends(street):
    moved = along(street, 10.0, [("RX0", "RX8")])
    east = [link.rx[0] for link in moved.links]
    assert east == pytest.approx([20.0, 30.0, 40.0, 50.0, 60.0])
    assert {link.tx for link in moved.links} == {TX}
