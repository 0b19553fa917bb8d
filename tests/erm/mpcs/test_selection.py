"""Which MPCs may be single reflections: the physics that excludes the others."""

import numpy as np
import pytest
from scipy.constants import c

from erm.common.errors import DataError
from erm.geometry.vertical import azimuth_of
from erm.mpcs.antenna_pairs import links
from erm.mpcs.clusters import clusters
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import reflection_loss, select
from erm.mpcs.table import make_table

TX, RX, FREQUENCY = np.array([0.0, 0.0, 28.4]), np.array([80.0, 10.0, 1.4]), 132e9
DIRECT = float(np.linalg.norm(TX - RX))
TOWARD_TX = float(azimuth_of(TX - RX))


def table(rows, **columns):
    """Table of (path length [m], azimuth [degree], loss above free space [dB]) at one position."""
    length, azimuth, loss = np.array(rows, dtype=float).T
    gain = 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - loss
    return make_table(
        {"position": "RX1", "tx_position": TX, "rx_position": RX, "frequency": FREQUENCY}
        | {"delay": length / c, "azimuth": azimuth, "path_gain": gain}
        | {name: np.broadcast_to(value, len(rows)) for name, value in columns.items()}
    )


def test_reflection_loss_is_the_loss_above_free_space():
    np.testing.assert_allclose(reflection_loss(table([(100, 10, 7.5), (200, 40, 0.0)])), [7.5, 0.0], atol=1e-9)


@pytest.mark.parametrize("los", [-1, 1])
def test_the_direct_path_is_found_by_delay_and_azimuth_with_or_without_the_flag(los):
    found = select(table([(DIRECT, TOWARD_TX + 3, 0), (DIRECT + 40, 80, 6), (DIRECT + 0.1, 80, 6)], los=los))
    assert found["reason"].values[0] == Reason.DIRECT_PATH
    assert found["reason"].values[1] == Reason.ACCEPTED
    assert found["reason"].values[2] != Reason.DIRECT_PATH  # arrives from elsewhere


def test_a_ground_reflection_is_no_wall():
    length = np.hypot(np.linalg.norm((TX - RX)[:2]), TX[2] + RX[2] - 2 * 0.3)
    rows = [(length, TOWARD_TX + 1, 8)]
    assert select(table(rows), ground_height=0.3)["reason"].item() == Reason.GROUND_REFLECTION
    assert select(table(rows), ground_height=-20.0)["reason"].item() != Reason.GROUND_REFLECTION
    above = select(table(rows, elevation=18.0, elevation_std=1.0), ground_height=0.3)
    assert above["reason"].item() != Reason.GROUND_REFLECTION


def test_a_path_off_ground_or_ceiling_is_no_direct_path_of_a_badly_surveyed_receiver():
    # 0.2 m behind its true place, it arrives when the direct path should; the transmitter is 18 degrees up
    rows = [(DIRECT + 0.2, TOWARD_TX, 0), (DIRECT + 0.2, TOWARD_TX, 3), (DIRECT + 0.2, TOWARD_TX, 3)]
    reason = select(table(rows, elevation=np.array([18.0, -20.0, 28.0]), elevation_std=1.0))["reason"].values
    assert reason[0] == Reason.DIRECT_PATH
    assert (reason[1:] == Reason.ELEVATION).all()


def test_a_path_with_another_within_its_errors_by_chance_locates_no_wall():
    # ten paths over 90 m: pi 9 s_L 2 degrees / (360 90 m / 10) is 1 at an error of length of 57 m
    rows = [(DIRECT + 10 * n, 80 + 20 * n, 6) for n in range(10)]
    for length_std, uncertain in ((50.0, False), (65.0, True)):
        std = np.r_[np.full(9, 0.1), length_std] / c
        reason = select(table(rows, delay_std=std, azimuth_std=2.0))["reason"].values
        assert (reason[-1] == Reason.UNCERTAIN) == uncertain
        assert Reason.UNCERTAIN not in reason[:-1]


def test_elevation_of_a_wall_is_that_of_the_unfolded_line():
    elevation = np.rad2deg(np.arcsin((TX[2] - RX[2]) / 120))
    rows = [(120, 80, 6), (120, 80, 6)]
    given = table(rows, elevation=[elevation + 5, -elevation], elevation_std=1.0)
    given["azimuth"][1] = 140.0
    assert select(given)["reason"].values.tolist() == [Reason.ACCEPTED, Reason.ELEVATION]


def test_what_no_single_reflection_can_be_is_refused():
    rows = [(120, 60, -4), (120, 100, 11.9), (120, 140, 12.1), (DIRECT - 0.2, 220, 6)]
    reasons = select(table(rows), threshold="fixed")["reason"]
    assert reasons.values.tolist() == [
        Reason.ABOVE_FREE_SPACE,
        Reason.ACCEPTED,
        Reason.LOSS,
        Reason.TOO_SHORT,
    ]


def test_clusters_continue_across_azimuth_zero():
    rows = [(120, 358.0, 6), (120.5, 3.0, 9), (120.5, 20.0, 9), (130, 358.0, 9)]
    given = table(rows)
    cluster, strongest = clusters(given, links(given), delay_window=5e-9, azimuth_window=10.0)
    assert cluster[0] == cluster[1]
    assert len(np.unique(cluster)) == 3
    assert strongest.tolist() == [True, False, True, True]


def test_links_are_antenna_pairs_not_names():
    given = table([(120, 60, 6)] * 4)
    given["rx_position"][2:, 0] += 1
    given["tx_position"][3, 0] += 1
    assert links(given).tolist() == [0, 0, 1, 2]


def test_the_letters_threshold_is_twice_the_smallest_loss():
    nlos = [(120, 60, 4.0), (130, 100, 7.9), (140, 140, 8.1)]
    assert select(table(nlos), threshold="letter")["accepted"].values.tolist() == [True, True, False]
    # with line of sight the smallest loss is the direct path's, and the second one counts
    los = [(DIRECT, TOWARD_TX, 0.2), *nlos]
    assert select(table(los), threshold="letter")["accepted"].values.tolist() == [False, True, True, False]


def test_one_metal_wall_makes_the_letters_threshold_reject_concrete_and_the_fixed_one_not():
    rows = [(120, 60, 1.0), (130, 100, 6.0), (140, 140, 6.5)]
    assert select(table(rows), threshold="letter")["accepted"].values.sum() == 1
    assert select(table(rows))["accepted"].values.all()


def test_missing_standard_errors_are_filled_in_and_known_ones_kept():
    given = table([(120, 60, 6), (140, 100, 6)])
    given["azimuth_std"][0] = 0.25
    found = select(given, delay_std=2e-10, azimuth_std=4.0)
    assert found["azimuth_std"].values.tolist() == [0.25, 4.0]
    assert found["delay_std"].values.tolist() == [2e-10, 2e-10]
    assert np.isfinite(found["line_covariance"].values).all()


def test_an_unknown_threshold_is_named():
    with pytest.raises(DataError, match="fixed, letter"):
        select(table([(120, 60, 6)]), threshold="best")  # type: ignore[arg-type] # what is tested
