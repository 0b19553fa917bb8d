"""Table 3 comes out of the published points."""

import numpy as np
import pytest

from erm.evaluation.outline import summary
from erm.letter import published


@pytest.mark.parametrize("route", ["Route 1", "Route 2"])
def test_table_3_is_reproduced_to_a_centimetre(route):
    found = summary(published.errors()[route])
    for name, statistic in published.STATISTICS.items():
        assert abs(found[statistic] - published.TABLE_3[route][name]) < 0.01


def test_the_true_rmse_is_larger_than_what_is_printed_under_its_name():
    found = {entry.scenario: entry.recomputed for entry in published.table_3() if entry.statistic == "true RMSE"}
    assert found["Route 1"] == pytest.approx(2.06, abs=0.005)
    assert found["Route 2"] == pytest.approx(0.77, abs=0.005)
    assert np.isnan(found["Canyon"])


def test_the_printed_line_is_that_of_the_measured_points():
    slope, intercept = published.EAST_BUILDING_LINE
    along = np.diff(published.EAST_BUILDING, axis=0)[0]
    assert along[1] / along[0] == pytest.approx(slope, abs=0.005)
    assert published.EAST_BUILDING[0, 1] - along[1] / along[0] * published.EAST_BUILDING[0, 0] == pytest.approx(
        intercept, abs=0.01
    )


def test_turning_south_into_north_keeps_distances():
    turned = published.east_north(published.ROUTE_1_POINTS)
    assert turned[0].tolist() == [46.40, -36.35]
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(turned, axis=0), axis=1),
        np.linalg.norm(np.diff(published.ROUTE_1_POINTS, axis=0), axis=1),
    )


def test_tables_say_what_cannot_be_recomputed():
    csv = published.as_csv(published.table_3())
    assert "Canyon,min,1.00,\n" in csv
    assert "Route 1,true RMSE,,2.0636\n" in csv
    assert published.points_csv().count("\n") == 1 + 10 + 8
