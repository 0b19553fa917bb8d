"""Crowded tables: batches change no map, accidents make no walls, and a few strays hide none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

from erm.mpcs.selection import select
from erm.reconstruction.decision.pieces import SOLID_GAP
from erm.reconstruction.model.extent import footprint, stretches, without_strays
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import Lines, seed_line
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.poles import find_poles
from erm.reconstruction.reconstruct import reconstruct
from erm.reconstruction.search import greedy
from erm.reconstruction.search import images as images_of
from erm.reconstruction.search.consensus import _from_seeds as from_seeds
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.density import COMPANY, fewest_partners
from erm.reconstruction.search.false_alarm import accidental
from erm.reconstruction.search.greedy import Group, Trial, Turns
from erm.reconstruction.search.images import Images
from erm.reconstruction.search.refine_groups import settle

from ..bounces import TX, bounces, joined, paths_of

TXS = np.array([[5.0, 12.0, 28.4], [30.0, -10.0, 20.0]])
STREET = np.array([[90.0, -30.0], [180.0, -60.0], [12.0, -45.0]])  # normal [degree], offset [m]


def receivers(count, rng):
    return np.column_stack([rng.uniform(-25, 50, count), rng.uniform(-25, 25, count), np.full(count, 1.4)])


def anything(count, seed):
    """Paths from nowhere: a receiver each, any azimuth, up to 60 m longer than the direct one."""
    rng = np.random.default_rng(seed)
    tx, rx = TXS[np.arange(count) % 2], receivers(count, rng)
    length = np.linalg.norm(tx - rx, axis=-1) + rng.uniform(1, 60, count)
    return bounces(tx, rx, STREET[0]) | {"delay": length / c, "azimuth": rng.uniform(0, 360, count)}


def off_walls(count, seed):
    rng = np.random.default_rng(seed)
    return [bounces(TXS[np.arange(count) % 2], receivers(count, rng), wall) for wall in STREET]


def together(parts):
    """Paths in one table, of two transmitters."""
    paths = paths_of({name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
    return replace(paths, transmitter=(paths.tx[:, 0] != TXS[0, 0]).astype(np.int64))


def crowd(count=3000, each=40, seed=0):
    """Paths off three walls, 5 cm and 0.7 degree wrong, among many from nowhere."""
    paths = together([*off_walls(each, seed), anything(count, seed + 100)])
    rng = np.random.default_rng(seed + 200)
    length, azimuth = rng.standard_normal((2, len(paths)))
    return replace(paths, length=paths.length + 0.05 * length, azimuth=paths.azimuth + 0.7 * azimuth)


def members(groups):
    return [group.members.tolist() for group in groups]


@pytest.mark.slow
def test_batches_find_the_groups_that_one_seed_after_another_finds(monkeypatch):
    paths = crowd(each=100, seed=1)  # a seed that was put off here finds a group of its own
    ahead = find_groups(paths, 3)
    assert np.mean(fewest_partners(Images(paths), np.ones(len(paths), dtype=np.int64)) > 1) > 0.5  # crowded
    monkeypatch.setattr(greedy, "FEW", 1)
    monkeypatch.setattr(greedy, "MANY", 1)
    monkeypatch.setattr(images_of, "BATCH", 100)
    # whatever was taken is looked at and left out again
    monkeypatch.setattr(Images, "without", lambda self, _: self)
    alone = find_groups(paths, 3)
    assert members(ahead) == members(alone)
    assert len(ahead) >= len(STREET)


def test_a_seed_that_must_have_partners_waits_for_none_of_them_to_be_taken():
    paths = crowd(each=100)
    images, free = Images(paths), np.ones(len(paths), dtype=bool)
    partners = images.partners()
    seeds = np.flatnonzero(partners.sizes > 9)[:20]  # more than lines are laid through
    fewest = partners.sizes
    trials = from_seeds(images, seeds, partners, fewest, free)
    assert any(trial is not None for trial in trials)
    for seed, trial in zip(seeds.tolist(), trials, strict=True):
        assert trial is None or set(partners[seed].tolist()) <= set(trial.seen.tolist())
    free[partners.rows[partners.start[seeds]]] = False  # one of them
    assert [trial.found for trial in from_seeds(images, seeds, partners, fewest, free)] == [None] * len(seeds)


@pytest.mark.slow
def test_the_order_of_the_paths_changes_no_group():
    paths = crowd()
    shuffle = np.random.default_rng(9).permutation(len(paths))
    found = {tuple(sorted(group.members)) for group in find_groups(paths, 3)}
    shuffled = {tuple(sorted(shuffle[group.members])) for group in find_groups(paths.take(shuffle), 3)}
    assert found == shuffled


def test_the_images_of_free_paths_are_the_free_ones_of_all():
    paths = crowd()
    images = Images(paths)
    free = np.random.default_rng(2).random(len(paths)) < 0.3
    fewer = images.without(free)
    assert fewer is not images
    assert images.without(np.ones(len(paths), dtype=bool)) is images
    lines = Lines.of([group.line for group in find_groups(paths, 3)[:20]])
    of, rows = images.about(lines)
    some, others = fewer.about(lines)
    # a grid of fewer paths may look less far, never less than the gate
    assert set(zip(some.tolist(), others.tolist(), strict=True)) <= set(
        zip(of[free[rows]].tolist(), rows[free[rows]].tolist(), strict=True)
    )
    whole, part = settle(images, lines, free), settle(fewer, lines, free)
    assert [one.tolist() for one in whole.members] == [one.tolist() for one in part.members]


def test_a_line_whose_seed_another_gathers_waits_for_its_turn():
    (one, *_) = off_walls(12, 3)
    paths = together([one])
    line = fit_line(paths, seed_line(paths.take(np.array([0]))))
    twice = Lines.of([line, line])
    settled = settle(Images(paths), twice, np.ones(12, dtype=bool), np.array([0, 5]))
    assert settled.later.tolist() == [False, True]
    taken, waits = settled.members
    assert taken.tolist() == list(range(12))
    assert waits.tolist() == []


def test_trials_that_are_put_off_are_made_when_their_turn_comes():
    wanted = [np.array([0, 1]), np.array([1, 2]), np.array([3])]
    turns_ = Turns[Group](np.arange(4), min_support=1)

    def one_at_a_time(some, free):
        first = [Trial(Group(None, own), own) for own in (wanted[one][free[wanted[one]]] for one in some[:1].tolist())]
        return first + [None] * (len(some) - 1)

    turns_.take(np.arange(3), one_at_a_time)
    assert members(turns_.found) == [[0, 1], [2], [3]]


@pytest.mark.slow
def test_three_that_agree_are_an_accident_in_a_crowd_and_none_alone():
    paths = crowd(8_000)
    true = 3 * 40  # the first rows
    walls = [Wall(paths, group.line, group.members) for group in find_groups(paths, 3)]
    by_chance = accidental(walls)
    of_walls = np.array([np.mean(wall.members < true) > 0.5 for wall in walls])
    few = np.array([wall.support == 3 for wall in walls])
    assert np.count_nonzero(few) > 10
    assert np.mean(by_chance[few]) > 0.5
    assert np.count_nonzero(of_walls) >= 3
    assert not by_chance[of_walls & ~few].any()
    of_three = together(off_walls(3, 4))
    alone = of_three.take(np.arange(3))
    line = fit_line(alone, seed_line(alone.take(np.array([0]))))
    assert accidental([Wall(alone, line, np.arange(3))]).tolist() == [False]
    assert accidental([]).tolist() == []


def test_a_crowd_asks_for_more_partners_the_larger_it_is():
    def asked(count, partners=0):
        images = Images(together([anything(count, 6)]))
        return float(np.mean(fewest_partners(images, np.full(count, partners))))

    few, many, more = asked(100), asked(3_000), asked(30_000)
    assert few == 1.0
    assert few < many < more
    # paths in company are no crowd, they are walls: where no other is counted half a one is expected
    assert asked(30_000, partners=COMPANY) < many
    assert len(fewest_partners(Images(together([anything(0, 6)])), np.empty(0, dtype=np.int64))) == 0


def test_partners_are_those_of_all_whoever_is_asked():
    images = Images(crowd(500))
    asked = np.arange(len(images.paths)) % 3 == 0
    partners, some = images.partners(), images.partners(asked)
    assert partners.sizes[asked].sum() > 0
    for number, own in enumerate(some):
        assert np.sort(own).tolist() == (np.sort(partners[number]).tolist() if asked[number] else [])


@pytest.mark.slow
def test_four_links_that_meet_by_chance_are_no_pole():
    rng = np.random.default_rng(11)
    paths = together([anything(60_000, 11)])
    rx = np.column_stack([rng.uniform(-250, 250, (len(paths), 2)), paths.rx[:, 2]])
    length = np.linalg.norm(paths.tx - rx, axis=-1) + rng.uniform(1, 60, len(paths))
    paths = replace(paths, rx=rx, length=length, loss=rng.uniform(12, 24, len(paths)))
    assert find_poles(paths, [], 3) == []


def test_strays_on_the_line_of_a_wall_that_thousands_saw_make_it_no_longer():
    rng = np.random.default_rng(12)
    seen, strays = 3000, 120  # 4 %
    # a wall 10 m north; bounces between -20 and 20 m east, and anywhere along 400 m of its line
    at = np.r_[rng.uniform(-20, 20, seen), rng.uniform(-200, 200, strays)]
    rx = np.column_stack([2 * at - TXS[0, 0], np.full(len(at), TXS[0, 1]), np.full(len(at), 1.4)])
    paths = paths_of(bounces(np.tile(TXS[:1], (len(at), 1)), rx, np.array([90.0, 20.0])))
    wall = Wall(paths, fit_line(paths, seed_line(paths.take(np.array([0])))), np.arange(len(at)))
    print_ = footprint(wall, stretches(wall, SOLID_GAP))
    assert (print_.high - print_.low).sum() > 100  # it would stand far beyond its ends
    standing, kept = without_strays(wall)
    assert np.array_equal(standing.members, wall.members[kept])
    print_ = footprint(standing, stretches(standing, SOLID_GAP))
    # a member within 5 m of where the wall stands has its company
    assert (print_.high - print_.low).sum() < 40 + 2 * SOLID_GAP + 1
    assert np.isin(np.arange(seen), kept).all()
    few = wall.thinned(200)
    assert without_strays(few)[0] is few


@pytest.mark.parametrize(
    ("seen", "strays", "stands"), [(30, 0, True), (30, 6, False), (300, 6, True), (300, 60, False)]
)
def test_strays_through_a_wall_refute_it_if_they_are_many_beside_those_that_saw_it(seen, strays, stands):
    """Receivers behind the east wall say that they see the north wall past it."""
    east, north = np.array([[180.0, -90.0], [270.0, -70.0]])
    rng = np.random.default_rng(8)
    rx = np.column_stack([rng.uniform(12, 60, 800), rng.uniform(8, 50, 800), np.full(800, 1.4)])
    behind = np.column_stack([np.full(strays, 92.0), rng.uniform(15, 30, strays), np.full(strays, 1.4)])
    tx = np.tile(TX[:1], (800, 1))
    wall, other = bounces(tx[:seen], rx[:seen], east), bounces(tx, rx, north)
    over = bounces(tx[:strays], behind, north)
    environment, _ = reconstruct(select(joined([wall, other, over], 1e-11, 0.1)), max_gap=np.inf)
    # lines from the origin on; 1e-11 s are 3 mm
    assert np.any(np.abs(environment.reflectors["offset"].values + 90.0) < 0.1) == stands
