"""Dense clutter: batches change no map, false alarms make no walls, and a few strays hide no wall."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

from erm.common.odds import TWENTY_TO_ONE
from erm.mpcs.selection import select
from erm.reconstruction.model.extent import SOLID_GAP, solid_footprint, without_strays
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import Lines, seed_line
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.poles import find_poles
from erm.reconstruction.reconstruct import reconstruct
from erm.reconstruction.search import greedy
from erm.reconstruction.search import images as images_module
from erm.reconstruction.search.consensus import _grow_from_seeds as grow_from_seeds
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.density import MAX_REQUIRED_PARTNERS, required_partners
from erm.reconstruction.search.false_alarm import evidence
from erm.reconstruction.search.greedy import GreedySelection, Group, Trial
from erm.reconstruction.search.images import Images
from erm.reconstruction.search.refine_groups import refine_groups

from ..bounces import TX, bounces, joined, paths_of

TXS = np.array([[5.0, 12.0, 28.4], [30.0, -10.0, 20.0]])
STREET = np.array([[90.0, -30.0], [180.0, -60.0], [12.0, -45.0]])  # normal [degree], offset [m]


def receivers(count, rng):
    return np.column_stack([rng.uniform(-25, 50, count), rng.uniform(-25, 25, count), np.full(count, 1.4)])


def clutter(count, seed):
    """Clutter: one path per receiver, any azimuth, up to 60 m longer than the direct path."""
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


def dense_clutter(count=3000, each=40, seed=0):
    """Paths off three walls, with errors of 5 cm and 0.7 degree, in dense clutter."""
    paths = together([*off_walls(each, seed), clutter(count, seed + 100)])
    rng = np.random.default_rng(seed + 200)
    length, azimuth = rng.standard_normal((2, len(paths)))
    return replace(paths, length=paths.length + 0.05 * length, azimuth=paths.azimuth + 0.7 * azimuth)


def inliers_of(groups):
    return [group.inliers.tolist() for group in groups]


@pytest.mark.slow
def test_batches_find_the_same_groups_as_one_seed_at_a_time(monkeypatch):
    paths = dense_clutter(each=100, seed=1)  # here a deferred seed finds a group of its own
    batched = find_groups(paths, 3)
    assert np.mean(required_partners(Images(paths), np.ones(len(paths), dtype=np.int64)) > 1) > 0.5  # dense
    monkeypatch.setattr(greedy, "MIN_BATCH", 1)
    monkeypatch.setattr(greedy, "MAX_BATCH", 1)
    monkeypatch.setattr(images_module, "BATCH_PATHS", 100)
    # taken paths are searched, too, and then left out
    monkeypatch.setattr(Images, "restricted_to_free", lambda self, _: self)
    alone = find_groups(paths, 3)
    assert inliers_of(batched) == inliers_of(alone)
    assert len(batched) >= len(STREET)


def test_a_seed_that_needs_all_its_partners_depends_on_them():
    paths = dense_clutter(each=100)
    images, free = Images(paths), np.ones(len(paths), dtype=bool)
    partners = images.partners()
    seeds = np.flatnonzero(partners.sizes > 9)[:20]  # more than are tried as starts
    required = partners.sizes
    trials = grow_from_seeds(images, seeds, partners, required, free)
    assert any(trial is not None for trial in trials)
    for seed, trial in zip(seeds.tolist(), trials, strict=True):
        assert trial is None or set(partners[seed].tolist()) <= set(trial.depends_on.tolist())
    free[partners.rows[partners.start[seeds]]] = False  # one of them
    assert [trial.found for trial in grow_from_seeds(images, seeds, partners, required, free)] == [None] * len(seeds)


@pytest.mark.slow
def test_the_order_of_the_paths_changes_no_group():
    paths = dense_clutter()
    shuffle = np.random.default_rng(9).permutation(len(paths))
    found = {tuple(sorted(group.inliers)) for group in find_groups(paths, 3)}
    shuffled = {tuple(sorted(shuffle[group.inliers])) for group in find_groups(paths.take(shuffle), 3)}
    assert found == shuffled


@pytest.mark.slow
def test_images_restricted_to_free_paths_are_the_free_ones_of_all():
    paths = dense_clutter()
    images = Images(paths)
    free = np.random.default_rng(2).random(len(paths)) < 0.3
    fewer = images.restricted_to_free(free)
    assert fewer is not images
    assert images.restricted_to_free(np.ones(len(paths), dtype=bool)) is images
    lines = Lines.from_list([group.line for group in find_groups(paths, 3)[:20]])
    of, rows = images.near_lines(lines)
    some, others = fewer.near_lines(lines)
    # a grid of fewer paths may search a smaller radius, but never less than the gate
    assert set(zip(some.tolist(), others.tolist(), strict=True)) <= set(
        zip(of[free[rows]].tolist(), rows[free[rows]].tolist(), strict=True)
    )
    whole, part = refine_groups(images, lines, free), refine_groups(fewer, lines, free)
    assert [one.tolist() for one in whole.inliers] == [one.tolist() for one in part.inliers]


def test_a_line_whose_seed_another_collects_is_deferred():
    (one, *_) = off_walls(12, 3)
    paths = together([one])
    line = fit_line(paths, seed_line(paths.take(np.array([0]))))
    twice = Lines.from_list([line, line])
    refined = refine_groups(Images(paths), twice, np.ones(12, dtype=bool), np.array([0, 5]))
    assert refined.deferred.tolist() == [False, True]
    taken, waits = refined.inliers
    assert taken.tolist() == list(range(12))
    assert waits.tolist() == []


def test_deferred_trials_are_made_later():
    wanted = [np.array([0, 1]), np.array([1, 2]), np.array([3])]
    selection = GreedySelection[Group](np.arange(4), min_support=1)

    def one_at_a_time(some, free):
        first = [Trial(Group(None, own), own) for own in (wanted[one][free[wanted[one]]] for one in some[:1].tolist())]
        return first + [None] * (len(some) - 1)

    selection.run(np.arange(3), one_at_a_time)
    assert inliers_of(selection.found) == [[0, 1], [2], [3]]


@pytest.mark.slow
def test_three_paths_that_agree_are_a_false_alarm_in_dense_clutter_only():
    paths = dense_clutter(8_000)
    groups = find_groups(paths, 3)
    of_walls = np.array([np.mean(group.inliers < 3 * 40) > 0.5 for group in groups])  # the first rows
    assert np.count_nonzero(of_walls) >= 3
    assert np.count_nonzero(~of_walls) <= 1
    alone = together(off_walls(3, 4)).take(np.arange(3))
    wall = Wall(alone, fit_line(alone, seed_line(alone.take(np.array([0])))), np.arange(3))
    assert evidence([wall]) > TWENTY_TO_ONE
    # with as many paths of the same link about each as its errors hold, no number of them is evidence
    among = replace(alone, clutter=1 / (2 * np.pi * alone.length_std * alone.azimuth_std))
    assert evidence([replace(wall, all_paths=among)]) < -TWENTY_TO_ONE
    assert len(evidence([])) == 0


def test_elevations_off_a_vertical_wall_speak_against_it_and_those_on_it_for_it():
    alone = together(off_walls(3, 4)).take(np.arange(3))
    line = fit_line(alone, seed_line(alone.take(np.array([0]))))

    def total(excess):
        paths = replace(alone, elevation_excess=np.full(3, excess), elevation_std=np.ones(3))
        return evidence([Wall(paths, line, np.arange(3))]).item()

    # of clutter's 30 degrees: ln(30 / (sqrt(2 pi) sqrt(2))) each, less 8**2 / (2 * 2)
    assert total(0.0) - total(np.nan) == pytest.approx(3 * 2.136, abs=0.05)
    assert total(8.0) - total(0.0) == pytest.approx(-3 * 16, rel=0.15)  # others may disturb a path


@pytest.mark.slow
def test_more_partners_are_required_the_denser_the_clutter():
    def asked(count, partners=0):
        images = Images(together([clutter(count, 6)]))
        return float(np.mean(required_partners(images, np.full(count, partners))))

    few, many, more = asked(100), asked(3_000), asked(30_000)
    assert few == 1.0
    assert few < many < more
    # paths with many partners are walls and do not count as clutter; half a path is then assumed
    assert asked(30_000, partners=MAX_REQUIRED_PARTNERS) < many
    assert len(required_partners(Images(together([clutter(0, 6)])), np.empty(0, dtype=np.int64))) == 0


def test_partners_of_some_seeds_are_those_of_all():
    images = Images(dense_clutter(500))
    asked = np.arange(len(images.paths)) % 3 == 0
    partners, some = images.partners(), images.partners(asked)
    assert partners.sizes[asked].sum() > 0
    for number, own in enumerate(some):
        assert np.sort(own).tolist() == (np.sort(partners[number]).tolist() if asked[number] else [])


@pytest.mark.slow
def test_four_links_that_agree_by_chance_are_no_pole():
    rng = np.random.default_rng(11)
    paths = together([clutter(60_000, 11)])
    rx = np.column_stack([rng.uniform(-250, 250, (len(paths), 2)), paths.rx[:, 2]])
    length = np.linalg.norm(paths.tx - rx, axis=-1) + rng.uniform(1, 60, len(paths))
    paths = replace(paths, rx=rx, length=length, loss=rng.uniform(12, 24, len(paths)))
    assert find_poles(paths, [], 3) == []


def test_strays_on_the_line_of_a_well_supported_wall_do_not_extend_it():
    rng = np.random.default_rng(12)
    seen, strays = 3000, 120  # 4 %
    # a wall 10 m north; reflection points between -20 and 20 m east, and anywhere along 400 m of its line
    at = np.r_[rng.uniform(-20, 20, seen), rng.uniform(-200, 200, strays)]
    rx = np.column_stack([2 * at - TXS[0, 0], np.full(len(at), TXS[0, 1]), np.full(len(at), 1.4)])
    paths = paths_of(bounces(np.tile(TXS[:1], (len(at), 1)), rx, np.array([90.0, 20.0])))
    wall = Wall(paths, fit_line(paths, seed_line(paths.take(np.array([0])))), np.arange(len(at)))
    extent = solid_footprint(wall)
    assert (extent.high - extent.low).sum() > 100  # it would stand far beyond its ends
    standing, kept = without_strays(wall)
    assert np.array_equal(standing.inliers, wall.inliers[kept])
    extent = solid_footprint(standing)
    # an inlier within 5 m of the wall has company
    assert (extent.high - extent.low).sum() < 40 + 2 * SOLID_GAP + 1
    assert np.isin(np.arange(seen), kept).all()
    few = wall.thinned(200)
    assert without_strays(few)[0] is few


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seen", "through", "stands"), [(30, 0, True), (30, 2, True), (300, 6, True), (300, 300, False)]
)
def test_paths_through_a_wall_refute_it_if_it_would_need_many_openings(seen, through, stands):
    """Receivers behind the east wall received the north wall through it, at the height of its reflection points."""
    east, north = np.array([[180.0, -90.0], [270.0, -70.0]])
    rng = np.random.default_rng(8)
    rx = np.column_stack([rng.uniform(12, 60, 800), rng.uniform(8, 50, 800), np.full(800, 1.4)])
    behind = np.column_stack([np.full(through, 92.0), rng.uniform(15, 30, through), np.full(through, 12.0)])
    tx = np.tile(TX[:1], (800, 1))
    wall, other = bounces(tx[:seen], rx[:seen], east), bounces(tx, rx, north)
    over = bounces(tx[:through], behind, north)
    environment, _ = reconstruct(select(joined([wall, other, over], 1e-11, 0.1)), max_gap=np.inf)
    # lines from the origin on; 1e-11 s are 3 mm
    assert np.any(np.abs(environment.reflectors["offset"].values + 90.0) < 0.1) == stands
