"""Angles of departure tell single reflections from multiple ones."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import select

STREET = erm.Environment.walls([[[-60, 10], [60, 10]], [[-60, -12], [60, -12]]], top=40.0)
TX = np.array([0.0, 0.0, 9.0])


def measured(seed: int, count: int = 20, std: float = 0.5, zero: float = 0.0) -> tuple[xr.Dataset, np.ndarray]:
    """Table of a street with departures to ``std`` degrees, and the number of reflections of each path."""
    rng = np.random.default_rng(seed)
    tables, orders = [], []
    for rx in np.column_stack([rng.uniform(8, 50, count), rng.uniform(-9, 8, count), np.full(count, 1.5)]):
        paths, table = (of(STREET, TX, rx, 132e9, max_order=2) for of in (erm.trace, erm.predict))
        n = table.sizes["mpc"]
        columns = {
            "delay": table["delay"].values + 1e-10 * rng.standard_normal(n),
            "azimuth": table["azimuth"].values + std * rng.standard_normal(n),
            "departure_azimuth": paths["departure_azimuth"].values + zero + std * rng.standard_normal(n),
            "departure_elevation": paths["departure_elevation"].values + std * rng.standard_normal(n),
        }
        columns |= {f"{name}_std": np.full(n, 1e-10 if name == "delay" else std) for name in columns}
        tables.append(table.assign({name: ("mpc", column) for name, column in columns.items()}))
        orders.append(paths["order"].values)
    return xr.concat(tables, dim="mpc"), np.concatenate(orders)


@pytest.mark.slow
@pytest.mark.parametrize("zero", [0.0, 120.0])
def test_double_reflections_are_told_and_single_ones_kept_whatever_the_zero_of_the_transmitter(zero):
    table, order = measured(1, zero=zero)
    reason = select(table)["reason"].values
    assert (reason[order == 1] == Reason.ACCEPTED).all()
    assert np.mean(reason[order == 2] == Reason.DEPARTURE) > 0.9
    assert (
        select(table.assign(departure_azimuth=table["azimuth"] * np.nan))["reason"].values != Reason.DEPARTURE
    ).all()


def test_errors_of_departures_that_are_large_tell_nothing():
    table, _ = measured(2, count=5)
    vague = table.assign(departure_azimuth_std=table["azimuth_std"] * 200)
    assert (select(vague)["reason"].values != Reason.DEPARTURE).all()


def test_a_path_that_left_upward_is_off_no_vertical_wall():
    table, order = measured(3, count=5)
    single = np.flatnonzero(order == 1)[:1]
    elevation = table["departure_elevation"].values.copy()
    elevation[single] += 15
    reason = select(table.assign(departure_elevation=("mpc", elevation)))["reason"].values
    assert reason[single] == Reason.ELEVATION


def test_columns_of_departures_are_read_and_written(tmp_path):
    table, _ = measured(4, count=2)
    erm.write_mpcs(table, tmp_path / "mpcs.csv")
    again, problems = erm.read_mpcs([tmp_path / "mpcs.csv"])
    assert problems == []
    for name in ("departure_azimuth", "departure_elevation", "departure_azimuth_std", "departure_elevation_std"):
        np.testing.assert_array_equal(again[name].values, table[name].values)
