"""A map of all other positions predicts what a position measured, where others saw the same walls."""

import numpy as np
import pytest

from erm.environment import Environment
from erm.errors import DataError
from erm.holdout import leave_one_out, prolonged, score
from erm.mpc_table import empty_table, make_table
from erm.trace import trace

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 6.0])
STREET = Environment.walls([[[-5.0, 12.0], [80.0, 12.0]], [[-5.0, -9.0], [80.0, -9.0]]], top=9.0, material="glass")


def street():
    """Exact single bounces and direct paths along a street."""
    parts = []
    for east in np.linspace(15, 60, 10):
        rx = np.array([east, 1.0, 1.5])
        paths = trace(STREET, TX, rx, FREQUENCY, max_order=1)
        ends = {"position": f"RX{east:.0f}", "tx_position": TX, "rx_position": rx, "frequency": FREQUENCY}
        parts.append(make_table(ends | {n: paths[n].values for n in ("delay", "azimuth", "elevation", "path_gain")}))
    import xarray as xr

    return xr.concat(parts, dim="mpc")


def test_positions_amid_others_are_predicted():
    predictions = leave_one_out(street(), max_order=1)
    assert len(predictions) == 10
    for one in predictions[1:-1]:
        assert one.right.all()
    result = score(predictions)
    assert result["positions_right"] >= 0.8
    assert result["delay"] < 1e-12
    assert result["gain"] < 1.0


def test_a_gain_that_was_measured_badly_is_told_from_one_that_is_predicted_badly():
    table = street()
    table["path_gain_std"][:] = 0.5
    wrong = table.sizes["mpc"] // 2
    table["path_gain"][wrong] = table["path_gain"].values[wrong] + 8.0
    result = score(leave_one_out(table, max_order=1, strongest=1))
    assert result["positions_located"] > result["positions_right"]
    assert result["positions_compatible"] == result["positions_right"]
    table["path_gain_std"][wrong] = 5.0
    assert score(leave_one_out(table, max_order=1, strongest=1))["positions_compatible"] == result["positions_located"]


def test_a_gain_that_only_the_elevation_was_wrong_of_is_right_given_the_predicted_one():
    table = street()
    result = score(leave_one_out(table, max_order=1, strongest=1))
    assert result["positions_given"] == result["positions_right"]  # nothing is known of the antenna
    # seen 6 degrees too low down a lobe of 1 dB/degree
    table["elevation"][:] = table["elevation"].values - 6.0
    table["path_gain"][:] = table["path_gain"].values - 6.0
    for name, value in (("elevation_std", 4.0), ("gain_slope", 1.0), ("gain_curvature", 0.0), ("path_gain_std", 4.0)):
        table[name][:] = value
    biased = score(leave_one_out(table, max_order=1, strongest=1))
    assert biased["positions_right"] == 0.0
    assert biased["positions_given"] == result["positions_right"]


def test_a_wall_that_may_go_on_does_not_hide_what_was_seen_beside_it():
    # the far wall is seen past the end of the near one, which would hide it were it as long as it may be
    near, far = [[10.0, 8.0], [20.0, 8.0]], [[0.0, 30.0], [60.0, 30.0]]
    known = Environment.walls([near, far], top=9.0)
    rx = np.array([50.0, 0.0, 1.5])
    longer = prolonged(known, 10.0)
    orders = [trace(longer, TX, rx, FREQUENCY, max_order=1, obstacles=hiding)["order"] for hiding in (longer, known)]
    assert [int(order.sum()) for order in orders] == [1, 2]


def test_longer_walls_stay_on_their_lines():
    longer = prolonged(STREET, 5.0).reflectors
    length = np.linalg.norm(np.diff(longer["end_points"].values, axis=1)[:, 0], axis=-1)
    np.testing.assert_allclose(length, 95.0)
    np.testing.assert_allclose(longer["offset"], STREET.reflectors["offset"])


def test_one_position_leaves_nothing_to_predict_from():
    with pytest.raises(DataError, match="at least two"):
        leave_one_out(empty_table())
