"""Conventions of a table are told apart by the direct paths; a table as expected gives no remark."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.survey.conventions import contradictions, offsets

from .streets import noisy, street

pytestmark = pytest.mark.slow

CHANGES = {
    "radians": lambda t: t.assign(azimuth=np.deg2rad(t["azimuth"])),
    "compass": lambda t: t.assign(azimuth=90 - t["azimuth"]),
    "mirrored": lambda t: t.assign(azimuth=-t["azimuth"]),
    "opposite sign": lambda t: t.assign(elevation=-t["elevation"]),
    "zenith": lambda t: t.assign(elevation=90 - t["elevation"]),
    "loss": lambda t: t.assign(path_gain=-t["path_gain"]),
    "GHz": lambda t: t.assign(frequency=t["frequency"] / 1e9),
    "nanoseconds": lambda t: t.assign(delay=t["delay"] * 1e9),
    "feet": lambda t: t.assign(tx_position=t["tx_position"] / 0.3048, rx_position=t["rx_position"] / 0.3048),
    "TX and RX": lambda t: t.assign(tx_position=t["rx_position"], rx_position=t["tx_position"]),
    "north": lambda t: t.assign(tx_position=t["tx_position"][:, [1, 0, 2]], rx_position=t["rx_position"][:, [1, 0, 2]]),
}


@pytest.mark.parametrize("word", CHANGES)
def test_a_convention_is_named_and_only_that(word):
    causes = contradictions(CHANGES[word](street()))
    assert len(causes) == 1
    assert word in causes[0].text
    # a bearing and exchanged axes agree equally well, and both are named
    assert len(causes[0].conventions) == (2 if word in ("compass", "north") else 1)


def three_links() -> xr.Dataset:
    table = street()
    _, link = np.unique(table["rx_position"], axis=0, return_inverse=True)
    return table.isel(mpc=np.flatnonzero(np.isin(link.ravel(), [0, 3, 6])))


@pytest.mark.parametrize("word", ["mirrored", "feet", "TX and RX", "north", "opposite sign"])
def test_three_direct_paths_tell_a_convention(word):
    table = three_links()
    assert contradictions(table) == []
    assert word in contradictions(CHANGES[word](table))[0].text


def test_three_direct_paths_tell_heading_and_clock():
    table, both = three_links(), ("heading", "clock")
    assert offsets(table, both) == []
    turned = table.assign(azimuth=table["azimuth"] + 10, delay=table["delay"] - 10e-9)
    heading, clock = (cause.text for cause in offsets(turned, both))
    assert float(heading.split()[1]) == pytest.approx(10, abs=0.3)
    assert float(clock.split()[1]) == pytest.approx(-10, abs=0.1)
    assert offsets(turned, ["gain"]) == []


def test_conventions_that_are_wrong_together_are_all_named():
    table = street()
    for word in ("radians", "nanoseconds", "GHz"):
        table = CHANGES[word](table)
    named = " ".join(cause.text for cause in contradictions(table))
    assert all(word in named for word in ("radians", "nanoseconds", "GHz"))


@pytest.mark.parametrize("heading", [0.0, 5.0, -20.0])
def test_common_errors_are_no_convention(heading):
    true = street()
    table = true.assign(azimuth=true["azimuth"] + heading, delay=true["delay"] + 4e-9, path_gain=true["path_gain"] - 55)
    assert contradictions(table) == []


def test_nothing_is_named_without_direct_paths():
    table: xr.Dataset = street()
    excess = table["delay"] * 299792458 - np.linalg.norm(table["tx_position"] - table["rx_position"], axis=1)
    table = table.isel(mpc=np.flatnonzero(excess > 1))
    assert contradictions(table) == []
    assert contradictions(table.assign(azimuth=90 - table["azimuth"])) == []


@pytest.mark.parametrize("seed", [16, 30])
def test_first_reflections_off_both_sides_of_a_street_are_no_mirrored_direct_paths(seed):
    rng = np.random.default_rng([31, seed])
    walls = []
    for side in (-1, 1):
        east = -80.0
        while east < 80:
            length, line = rng.uniform(12, 40), side * rng.uniform(9, 16)
            turn = rng.normal(0, 0.03) * length
            walls.append([[east, line - turn], [east + length, line + turn]])
            east += length + rng.uniform(0, 6)
    receivers = np.column_stack([rng.uniform(-60, 60, 24), rng.uniform(-7, 7, 24), np.full(24, 1.5)])
    tx = (rng.uniform(-60, 60), rng.uniform(-7, 7), rng.uniform(4, 15))
    street = erm.Environment.walls(walls, top=20.0)
    links = [erm.predict(street, tx, rx, 132e9, max_order=2) for rx in receivers]
    table = xr.concat([link.isel(mpc=link["order"].values > 0) for link in links], dim="mpc")
    assert contradictions(noisy(table, rng)) == []
