"""Trials in batches find what one trial after another finds; ragged arrays are lists."""

from itertools import pairwise

import numpy as np
import pytest

from erm.reconstruction.model.fit import fit_line, fit_lines, misfit, misfits
from erm.reconstruction.model.grid import Grid
from erm.reconstruction.model.line import Lines, seed_line
from erm.reconstruction.model.loss import weighted_quantile, weighted_quantiles
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.model.ragged import Ragged, list_sums
from erm.reconstruction.search.greedy import GreedySelection, Group, Trial


def overlapping_groups(rng, count=300):
    """Paths that the group of each seed would take; neighbouring groups overlap."""
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
def test_batches_find_what_one_seed_after_another_finds(seed):
    rng = np.random.default_rng(seed)
    wanted = overlapping_groups(rng)
    order = rng.permutation(len(wanted))
    selection = GreedySelection[Group](np.arange(len(wanted)), min_support=3)

    def try_seeds(some, free):
        own = [wanted[one][free[wanted[one]]] for one in some.tolist()]
        return [Trial(Group(None, inliers), inliers) for inliers in own]

    partners = Ragged.from_lists([rng.integers(0, len(wanted), 3) for _ in wanted])
    selection.run(order, try_seeds, partners)
    assert [group.inliers.tolist() for group in selection.found] == one_after_another(order, wanted, 3)
    assert not selection.free[np.concatenate([group.inliers for group in selection.found])].any()


def test_hypotheses_about_one_mpc_are_taken_once():
    selection = GreedySelection[Group](np.array([5, 5, 7, 7, 9]), min_support=1)
    inliers = [np.array([0, 2]), np.array([1, 4])]

    def try_seeds(some, free):
        own = [inliers[one][free[inliers[one]]] for one in some.tolist()]
        return [Trial(Group(None, one), one) for one in own]

    selection.run(np.arange(2), try_seeds)
    assert [group.inliers.tolist() for group in selection.found] == [[0, 2], [4]]
    assert not selection.free.any()


@pytest.mark.parametrize("radius", [0.0, 0.4, 5.0, 100.0])
def test_a_grid_finds_exactly_the_points_within_the_radius_on_their_sheet(radius):
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
    ragged = Ragged.from_lists(lists)
    assert [one.tolist() for one in ragged] == [[3, 1], [], [4, 1, 5]]
    assert [one.tolist() for one in ragged.take(np.array([2, 1, 2]))] == [[4, 1, 5], [], [4, 1, 5]]
    assert [one.tolist() for one in ragged.masked(ragged.rows != 1)] == [[3], [], [4, 5]]
    assert ragged.count_distinct(np.array([0, 9, 9, 9, 9, 2])).tolist() == [1, 0, 2]
    assert list_sums(np.array([1.0, 2, 3, 4, 5]), ragged.start).tolist() == [3, 0, 12]
    parts = [ragged.batch(part) for part in ragged.batches(2)]
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
        elevation_excess=column,
        elevation_std=column,
        row=np.arange(count),
        scatter=np.zeros((count, 2)),
        clutter=column + 1e-4,
    )


def test_walls_fitted_together_are_those_fitted_one_by_one():
    rng = np.random.default_rng(5)
    walls = [
        paths_off(normal, offset, count, rng) for normal, offset, count in ((200, -30, 5), (80, -41, 2), (10, -60, 9))
    ]
    columns = zip(*(vars(one).values() for one in walls), strict=True)
    together = Paths(*(np.concatenate(column) for column in columns))
    inliers = Ragged(np.arange(16), np.array([0, 5, 7, 16]))
    starts = [seed_line(one) for one in walls]
    lines = fit_lines(together.columns, inliers, Lines.from_list(starts))
    chi2 = misfits(together.columns, inliers.rows, lines, inliers.owner)
    for number, (one, start) in enumerate(zip(walls, starts, strict=True)):
        alone, same = fit_line(one, start), lines.line(number)
        # sums in another order differ by rounding, and steps end below 1e-11
        assert same.normal == pytest.approx(alone.normal, abs=1e-9)
        assert same.offset == pytest.approx(alone.offset, abs=1e-9)
        np.testing.assert_allclose(same.covariance, alone.covariance, rtol=1e-8)
        np.testing.assert_allclose(chi2[inliers.owner == number], misfit(one, alone), rtol=1e-6, atol=1e-9)
