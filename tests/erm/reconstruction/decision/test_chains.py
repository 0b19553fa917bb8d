"""Chains of reflections share an image as paths off a wall do, and are rejected."""

from dataclasses import replace

import numpy as np
import pytest

from erm.mpcs.reasons import Reason
from erm.mpcs.selection import select
from erm.reconstruction.decision.chains import ChainSearch
from erm.reconstruction.decision.decide import Candidates, KnownCurved
from erm.reconstruction.decision.multi_bounce import is_multi_bounce, mirror_of
from erm.reconstruction.model.extent import Legs
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import Lines, seed_line
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.reconstruct import reconstruct

from ..bounces import TX, WALLS, bounces, joined, paths_of, route, scene, sorted_lines


def wall_of(columns, loss=6.0):
    paths = paths_of(columns, loss=loss)
    everything = np.arange(len(paths))
    return Wall(paths, fit_line(paths, seed_line(paths.take(everything[:1]))), everything)


def test_a_double_reflection_is_found_by_the_image_of_the_image():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    south, north = WALLS[0], WALLS[2]
    mirrors = [mirror_of(wall_of(bounces(tx, rx, wall)), 60.0) for wall in (south, north)]
    both = bounces(tx, rx, south, north)
    assert is_multi_bounce(wall_of(both, loss=12.0), mirrors)
    assert not is_multi_bounce(wall_of(both, loss=12.0), mirrors[:1])
    assert not is_multi_bounce(wall_of(both, loss=1.0), mirrors)  # a double reflection loses what both walls lose
    assert not is_multi_bounce(wall_of(bounces(tx, rx, WALLS[1]), loss=12.0), mirrors)


@pytest.mark.parametrize(("normal_std", "explained"), [(0.01, True), (2.0, False)])
def test_a_chain_off_walls_that_are_known_badly_hides_no_wall(normal_std, explained):
    # 40 m away the image moves by 2.8 m for a normal that is 2 degrees off: it meets any wall
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    first, last = (wall_of(bounces(tx, rx, WALLS[i])) for i in (0, 2))
    unsure = replace(last, line=last.line._replace(covariance=np.diag([normal_std, 0.01]) ** 2))
    mirrors = [mirror_of(wall, 60.0) for wall in (first, unsure)]
    assert is_multi_bounce(wall_of(bounces(tx, rx, WALLS[0], WALLS[2]), loss=12.0), mirrors) == explained


@pytest.mark.slow
@pytest.mark.parametrize(("seen", "walls"), [((1, 1), 0), ((0, 1), 1)])
def test_walls_that_single_links_saw_explain_a_chain(seen, walls):
    # where nothing but a double reflection is shared its image would be the only wall of the map
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    parts = [bounces(tx, rx, WALLS[0], WALLS[2], loss=10.0)]
    parts += [bounces(tx[i : i + n], rx[i : i + n], WALLS[w]) for n, i, w in zip(seen, (2, 7), (0, 2), strict=True)]
    environment, _ = reconstruct(select(joined(parts, 2e-11, 0.1)))
    assert environment.reflectors.sizes["reflector"] == walls


def test_paths_that_lose_less_than_the_scene_are_no_likelier_off_a_wall():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    usual, strong = wall_of(bounces(tx, rx, WALLS[0]), loss=8.0), wall_of(bounces(tx[:4], rx[:4], WALLS[1]), loss=-8.0)
    none = KnownCurved(np.array([]), lambda paths, lines: (np.empty(0, int), np.empty(0, int)))
    alike = replace(strong, all_paths=replace(strong.all_paths, loss=usual.paths.loss[:4]))
    one, other = (Candidates([usual, wall], [], Legs(*np.empty((2, 0, 3))), 15.0, none) for wall in (strong, alike))
    assert one.log_odds(1) <= other.log_odds(1) + 0.5


@pytest.mark.parametrize(("offset_std", "some"), [(0.01, True), (0.4, False)])
def test_walls_that_are_known_badly_explain_no_chains(offset_std, some):
    # with an unknown clock both sides of a street are uncertain by decimetres: the face beside them fits as well
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    walls = [wall_of(bounces(tx, rx, WALLS[i])) for i in (0, 2)]
    lines = Lines.from_list([wall.line._replace(covariance=np.diag([0.01, offset_std]) ** 2) for wall in walls])
    joint = np.zeros((2, 2, 2, 2))
    joint[[0, 1], :, [0, 1]] = lines.covariance
    both = paths_of(bounces(tx, rx, WALLS[0], WALLS[2]), loss=12.0)
    found = ChainSearch(walls, both, 60.0).find(lines, joint)
    assert bool(found) == some


@pytest.mark.slow
@pytest.mark.parametrize("chain", [(0, 3), (3, 0), (0, 2), (1, 0)])
def test_double_reflections_that_agree_on_a_wall_are_rejected(chain):
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    singles = [bounces(tx, rx, wall, loss=5.0) for wall in WALLS]
    doubles = bounces(tx, rx, *(WALLS[i] for i in chain), loss=10.0)
    table = joined([*singles, doubles], 1e-10, 0.5)
    environment, merged = reconstruct(select(table), max_gap=np.inf)
    assert environment.reflectors.sizes["reflector"] == len(WALLS)
    assert not merged["accepted"].values[-len(rx) :].any()


def test_both_orders_of_a_double_reflection_reveal_a_hidden_wall():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    known, hidden = WALLS[0], WALLS[1]
    parts = [bounces(tx, rx, known, loss=5.0), bounces(tx[:5], rx[:5], known, hidden, loss=10.0)]
    parts.append(bounces(tx[5:10], rx[5:10], hidden, known, loss=10.0))
    environment, merged = reconstruct(select(joined(parts, 1e-10, 0.5)), max_gap=np.inf)
    assert sorted_lines(environment)[:, 0] == pytest.approx([known[0]], abs=1)
    assert not merged["accepted"].values[len(rx) :].any()


@pytest.mark.slow
def test_a_reflection_off_wall_and_ground_makes_no_second_wall():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    echo = bounces(tx, rx, WALLS[1], loss=11.0, height=tx[:, 2] + rx[:, 2])
    table = joined([bounces(tx, rx, WALLS[1], loss=5.0), echo], 1e-10, 0.5)
    environment, _ = reconstruct(select(table, delay_window=1e-9), max_gap=np.inf)
    assert environment.reflectors.sizes["reflector"] == 1


def test_a_wall_hidden_behind_another_is_rejected():
    walls = np.array([[90.0, -50.38], [90.0, -53.38]])
    environment, merged = reconstruct(select(scene(walls, TX[:1], route(24))), max_gap=np.inf)
    np.testing.assert_allclose(environment.reflectors["offset"], [-50.38], atol=1e-3)
    assert Reason.OBSTRUCTION in merged["reason"].values
