"""A map of all other positions predicts what a position measured, where others saw the same walls."""

import numpy as np
import pytest
import xarray as xr

from erm.common.errors import DataError
from erm.evaluation.leave_one_out import leave_one_out, resized, score
from erm.maps.environment import Environment
from erm.mpcs.selection import select
from erm.mpcs.table import empty_table, make_table
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 6.0])
STREET = Environment.walls([[[-5.0, 12.0], [80.0, 12.0]], [[-5.0, -9.0], [80.0, -9.0]]], top=9.0, material="glass")


def campaign(environment, receivers):
    """Exact single bounces and direct paths."""
    parts = []
    for number, rx in enumerate(receivers):
        paths = trace(environment, TX, rx, FREQUENCY, max_order=1)
        ends = {"position": f"RX{number}", "tx_position": TX, "rx_position": rx, "frequency": FREQUENCY}
        parts.append(make_table(ends | {n: paths[n].values for n in ("delay", "azimuth", "elevation", "path_gain")}))
    return xr.concat(parts, dim="mpc")


def street():
    return campaign(STREET, [np.array([east, 1.0, 1.5]) for east in np.linspace(15, 60, 10)])


@pytest.mark.slow
def test_positions_amid_others_are_predicted():
    predictions = leave_one_out(street(), max_order=1)
    assert len(predictions) == 10
    for one in predictions[1:-1]:
        assert one.right.all()
    result = score(predictions)
    assert result["positions_right"] >= 0.8
    assert result["delay"] < 1e-12
    assert result["gain"] < 1.0


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_gain_that_only_the_elevation_was_wrong_of_counts_at_the_elevation_that_heights_imply():
    table = street()
    result = score(leave_one_out(table, max_order=1, strongest=2))
    assert result["positions_reported"] == result["positions_right"]  # nothing is known of the antenna
    # every second one seen 3 degrees too low down a lobe of 2 dB/degree: others are the strongest by what is reported
    low = np.where(np.arange(table.sizes["mpc"]) % 2, 3.0, 0.0)
    table["elevation"][:] = table["elevation"].values - low
    table["path_gain"][:] = table["path_gain"].values - 2.0 * low
    for name, value in (("elevation_std", 4.0), ("gain_slope", 2.0), ("gain_curvature", 0.0), ("path_gain_std", 4.0)):
        table[name][:] = value
    biased = leave_one_out(table, max_order=1, strongest=2)
    assert score(biased)["positions_reported"] == 0.0
    assert score(biased)["positions_right"] == result["positions_right"]
    assert all(np.min(np.abs(one.gain_reported)) < 3 for one in biased)  # the direct path and another, or not


def test_a_wall_that_may_go_on_does_not_hide_what_was_seen_beside_it():
    # the far wall is seen past the end of the near one, which would hide it were it as long as it may be
    near, far = [[10.0, 8.0], [20.0, 8.0]], [[0.0, 30.0], [60.0, 30.0]]
    known = Environment.walls([near, far], top=9.0)
    rx = np.array([50.0, 0.0, 1.5])
    longer = resized(known, 10.0, 10.0)
    orders = [trace(longer, TX, rx, FREQUENCY, max_order=1, obstacles=hiding)["order"] for hiding in (longer, known)]
    assert [int(order.sum()) for order in orders] == [1, 2]


@pytest.mark.slow
def test_a_wall_hides_only_where_reflection_points_say_that_it_stands():
    # the near wall's last reflection point lies 19.9 m east, and its Fresnel zone reaches further; the path that is
    # left out passes 20.1 m east on its way back from the far wall
    known = Environment.walls([[[10.0, 8.0], [20.0, 8.0]], [[0.0, 30.0], [60.0, 30.0]]], top=9.0, material="glass")
    table = campaign(known, [np.array([east, 0.0, 1.5]) for east in (20.1 * 30 / 26, *np.linspace(24, 39.8, 8))])
    environment, _ = reconstruct(select(table.isel(mpc=table["position"].values != "RX0")))
    assert environment.reflectors["end_points"].values[..., 0].max(axis=-1).min() > 20.1
    assert leave_one_out(table, max_order=1)[0].right.all()


@pytest.mark.parametrize(("beyond", "length"), [(5.0, 95.0), (-0.5, 84.0), (-100.0, 8.5)])
def test_longer_and_shorter_walls_stay_on_their_lines(beyond, length):
    changed = resized(STREET, beyond, 0.0).reflectors
    np.testing.assert_allclose(np.linalg.norm(np.diff(changed["end_points"].values, axis=1)[:, 0], axis=-1), length)
    np.testing.assert_allclose(changed["offset"], STREET.reflectors["offset"])
    np.testing.assert_allclose(changed["end_points"].mean("end"), STREET.reflectors["end_points"].mean("end"))


def test_one_position_leaves_nothing_to_predict_from():
    with pytest.raises(DataError, match="at least two"):
        leave_one_out(empty_table())
