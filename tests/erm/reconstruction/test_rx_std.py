"""Receivers whose places are known to a decimetre: walls are no worse than their covariances say."""

import numpy as np
import pytest

from erm.common.errors import DataError
from erm.maps.environment import Environment
from erm.mpcs.selection import select
from erm.mpcs.table import empty_table, make_table
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 8.0])
WALL = Environment.walls([[[-30.0, 20.0], [80.0, 20.0]]], top=30.0, material="concrete")
RX_STD, DELAY_STD, AZIMUTH_STD = 0.1, 1e-11, 0.1  # m, s, degree
DRAWS, PLACES = 60, 9


def campaign(rng):
    """Single bounces off one wall at nine places, each surveyed wrongly."""
    columns = {name: [] for name in ("position", "rx_position", "delay", "azimuth", "elevation", "path_gain")}
    for number, east in enumerate(np.linspace(5, 60, PLACES)):
        rx = np.array([east, rng.uniform(-10, 5), 1.5])
        path = trace(WALL, TX, rx, FREQUENCY, max_order=1).isel(path=1)
        columns["position"].append(f"RX{number}")
        columns["rx_position"].append(rx + RX_STD * rng.standard_normal(3))
        columns["delay"].append(float(path["delay"]) + DELAY_STD * rng.standard_normal())
        columns["azimuth"].append(float(path["azimuth"]) + AZIMUTH_STD * rng.standard_normal())
        columns["elevation"].append(float(path["elevation"]))
        columns["path_gain"].append(float(path["path_gain"]))
    errors = {"delay_std": DELAY_STD, "azimuth_std": AZIMUTH_STD, "elevation_std": 0.5, "path_gain_std": 0.5}
    return make_table(
        {"tx_position": TX, "frequency": FREQUENCY, **{k: np.array(v) for k, v in columns.items()}, **errors}
    )


@pytest.mark.slow
def test_covariances_hold_for_receivers_that_stand_elsewhere():
    rng = np.random.default_rng(11)
    white = []
    for _ in range(DRAWS):
        environment, located = reconstruct(select(campaign(rng), rx_std=RX_STD))
        walls = environment.reflectors
        row = int(np.argmax(walls["support"].values))
        assert walls["support"].values[row] >= PLACES - 1
        # where the errors of normal and offset are all but independent: at the middle of the reflection points
        along = located["wall_point"].values[located["wall"].values == row, 0].mean()
        normal = np.deg2rad(walls["normal"].values[row])
        error = along * np.cos(normal) + 20.0 * np.sin(normal) - walls["offset"].values[row]
        slope = np.array([np.deg2rad(-along * np.sin(normal) + 20.0 * np.cos(normal)), -1.0])
        white.append(error / np.sqrt(slope @ walls["covariance"].values[row] @ slope))
    # 68 % of 60 draws are within one, with a standard error of 6 %, three of these either way; residuals that look
    # large by chance widen what the option says, and none narrow it, so that rather more are
    assert 0.5 < np.mean(np.abs(white) < 1) <= 0.9
    assert np.mean(np.abs(white) < 2) > 0.87


def test_a_receiver_cannot_be_better_known_than_exactly():
    with pytest.raises(DataError, match="expected 0 or more"):
        select(empty_table(), rx_std=-1.0)
