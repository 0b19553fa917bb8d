"""Trials ahead of their turn find what turns one after another find; arrays of lists are lists."""

from itertools import pairwise

import numpy as np
import pytest

from erm.reconstruction.model.fit import fit_line, fit_lines, misfit, misfits
from erm.reconstruction.model.grid import Grid
from erm.reconstruction.model.line import Lines, seed_line
from erm.reconstruction.model.loss import weighted_quantile, weighted_quantiles
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.model.ragged import Ragged, sums
from erm.reconstruction.search.greedy import Group, Trial, Turns


def claims(rng, count=300):
    """What each of many would like to have, in a world where tastes overlap."""
    return [np.unique(rng.integers(max(0, one - 12), min(count, one + 12), 6)) for one in range(count)]


def one_after_another(order, wanted, min_support):
    free, found = np.ones(len(wanted), dtype=bool), []
    for one in order.tolist():
        if free[one]:
            own = wanted[one][free[wanted[one]]]
            if len(own) >= min_support:
                free[own] = False
                found.append(own.tolist())
    return found


@pytest.mark.parametrize("seed", range(10))
def test_turns_tried_ahead_find_what_turns_one_after_another_find(seed):
    rng = np.random.default_rng(seed)
    wanted = claims(rng)
    order = rng.permutation(len(wanted))
    turns = Turns[Group](np.arange(len(wanted)), min_support=3)

    def trials(some, free):
        own = [wanted[one][free[wanted[one]]] for one in some.tolist()]
        return [Trial(Group(None, members), members) for members in own]

    partners = Ragged.of_lists([rng.integers(0, len(wanted), 3) for _ in wanted])
    turns.take(order, trials, partners)
    assert [group.members.tolist() for group in turns.found] == one_after_another(order, wanted, 3)
    assert not turns.free[np.concatenate([group.members for group in turns.found])].any()


def test_a_row_of_the_table_is_taken_once_whatever_its_hypotheses():
    turns = Turns[Group](np.array([5, 5, 7, 7, 9]), min_support=1)
    members = [np.array([0, 2]), np.array([1, 4])]

    def trials(some, free):
        own = [members[one][free[members[one]]] for one in some.tolist()]
        return [Trial(Group(None, one), one) for one in own]

    turns.take(np.arange(2), trials)
    assert [group.members.tolist() for group in turns.found] == [[0, 2], [4]]
    assert not turns.free.any()


@pytest.mark.parametrize("radius", [0.0, 0.4, 5.0, 100.0])
def test_a_grid_finds_all_points_in_reach_on_their_sheet_and_no_others(radius):
    rng = np.random.default_rng(3)
    points, sheet = rng.uniform(-40, 60, (500, 2)), rng.integers(0, 4, 500)
    places, of = rng.uniform(-60, 80, (80, 2)), rng.integers(0, 4, 80)
    reach = radius * rng.uniform(0.2, 1, 80)
    place, point, _ = Grid(points, sheet, 7.0).within(places, of, reach)
    near = np.linalg.norm(places[:, None] - points, axis=-1) <= reach[:, None]
    expected = np.argwhere(near & (of[:, None] == sheet))
    np.testing.assert_array_equal(np.column_stack([place, point])[np.lexsort((point, place))], expected)


def test_lists_in_one_array_are_the_lists():
    lists = [np.array([3, 1]), np.array([], dtype=np.int64), np.array([4, 1, 5])]
    ragged = Ragged.of_lists(lists)
    assert [one.tolist() for one in ragged] == [[3, 1], [], [4, 1, 5]]
    assert [one.tolist() for one in ragged.take(np.array([2, 1, 2]))] == [[4, 1, 5], [], [4, 1, 5]]
    assert [one.tolist() for one in ragged.kept(ragged.rows != 1)] == [[3], [], [4, 5]]
    assert ragged.distinct(np.array([0, 9, 9, 9, 9, 2])).tolist() == [1, 0, 2]
    assert sums(np.array([1.0, 2, 3, 4, 5]), ragged.start).tolist() == [3, 0, 12]
    parts = [ragged.part(part) for part in ragged.parts(2)]
    assert [one.tolist() for part in parts for one in part] == [one.tolist() for one in lists]
    assert len(parts) == 2


def test_quantiles_of_many_lists_are_those_of_each():
    rng = np.random.default_rng(4)
    sizes = rng.integers(1, 9, 50)
    start = np.concatenate([[0], np.cumsum(sizes)])
    values, weight = rng.normal(size=start[-1]), rng.uniform(0.1, 3, start[-1])
    together = weighted_quantiles(values, weight, start, 0.3)
    alone = [weighted_quantile(values[a:b], weight[a:b], 0.3) for a, b in pairwise(start.tolist())]
    np.testing.assert_allclose(together, alone, rtol=1e-12, atol=1e-12)


def paths_off(normal, offset, count, rng):
    """Paths with errors off one wall."""
    tx, rx = np.array([2.0, 3.0, 8.0]), np.column_stack([rng.uniform(-20, 20, (count, 2)), np.full(count, 1.5)])
    n = np.array([np.cos(np.deg2rad(normal)), np.sin(np.deg2rad(normal))])
    seen = tx[:2] + 2 * (offset - tx[:2] @ n) * n - rx[:, :2]
    column = np.zeros(count)
    return Paths(
        tx=np.tile(tx, (count, 1)),
        rx=rx,
        length=np.hypot(np.hypot(*seen.T), 6.5) + 0.03 * rng.standard_normal(count),
        azimuth=np.rad2deg(np.arctan2(seen[:, 1], seen[:, 0])) + 0.5 * rng.standard_normal(count),
        length_std=np.full(count, 0.03),
        azimuth_std=np.full(count, 0.5),
        link=np.arange(count),
        transmitter=column.astype(np.int64),
        loss=column,
        loss_std=column,
        wavelength=column + 0.002,
        rise=column,
        rise_std=column,
        row=np.arange(count),
    )


def test_walls_fitted_together_are_those_fitted_one_by_one():
    rng = np.random.default_rng(5)
    walls = [
        paths_off(normal, offset, count, rng) for normal, offset, count in ((200, -30, 5), (80, -41, 2), (10, -60, 9))
    ]
    columns = zip(*(vars(one).values() for one in walls), strict=True)
    together = Paths(*(np.concatenate(column) for column in columns))
    members = Ragged(np.arange(16), np.array([0, 5, 7, 16]))
    starts = [seed_line(one) for one in walls]
    lines = fit_lines(together.rays, members, Lines.of(starts))
    chi2 = misfits(together.rays, members.rows, lines, members.owner)
    for number, (one, start) in enumerate(zip(walls, starts, strict=True)):
        alone, same = fit_line(one, start), lines.one(number)
        # sums in another order differ by rounding, and steps end below 1e-11
        assert same.normal == pytest.approx(alone.normal, abs=1e-9)
        assert same.offset == pytest.approx(alone.offset, abs=1e-9)
        np.testing.assert_allclose(same.covariance, alone.covariance, rtol=1e-8)
        np.testing.assert_allclose(chi2[members.owner == number], misfit(one, alone), rtol=1e-6, atol=1e-9)
