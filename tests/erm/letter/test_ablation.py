"""MPCs are taken apart by what truly was behind them."""

import numpy as np
import pytest

from erm.letter.ablation import split_by_cause
from erm.letter.captures import Cached, Campaign, Link, Measured
from erm.letter.truth import as_table, rays_of
from erm.maps.environment import Environment


@pytest.fixture(scope="module")
def street() -> Campaign:
    place = Environment.walls([[[-20, 20], [90, 20]], [[90, -15], [-20, -15]]])
    links = tuple(Link(f"RX{i}", (0.0, 0.0, 10.0), (20.0 + 5 * i, 2.0, 2.0)) for i in range(4))
    return Campaign("street", place, links, 132e9, 2, {}, None)


def measured(campaign: Campaign, late: float):
    """All rays, each late by as much, with a standard deviation of 0.01 ns and 0.1 degrees."""
    table = as_table(campaign, rays_of(campaign))
    size = table.sizes["mpc"]
    std = {"delay_std": ("mpc", np.full(size, 1e-11)), "azimuth_std": ("mpc", np.full(size, 0.1))}
    return table.assign(delay=table["delay"] + late).assign(std)


def test_singles_are_the_single_bounces_and_their_errors_are_those_that_were_made(street):
    taken = split_by_cause(measured(street, 1e-10), street)
    assert (taken.available, taken.measured, taken.singles.sizes["mpc"]) == (8, 8, 8)
    assert taken.excess["delay"] == pytest.approx(10.0)
    np.testing.assert_allclose(taken.singles["delay"] - taken.exact["delay"], 1e-10, rtol=1e-6)
    np.testing.assert_allclose(taken.corrected["delay_std"], np.hypot(1e-11, 1e-10))
    np.testing.assert_allclose(taken.corrected["azimuth_std"], 0.1)  # azimuths were right


def test_what_no_path_is_near_to_is_left_out_of_what_is_known(street):
    table = measured(street, 0.0)
    lost = table.assign(delay=("mpc", table["delay"].values + np.where(np.arange(table.sizes["mpc"]) == 3, 5e-9, 0.0)))
    assert split_by_cause(lost, street).explained.sizes["mpc"] == table.sizes["mpc"] - 1


def test_no_link_is_measured_twice_with_the_same_instrument(street):
    asked = []

    class Counting:
        def measure(self, campaign, change, *, progress=None):
            asked.extend(link.name for link in campaign.links)
            table = measured(campaign, 0.0)
            return Measured(table, np.arange(table.sizes["mpc"], dtype=float))

    captures = Cached(Counting())
    captures.measure(street.at(street.links[1:3]))
    again = captures.measure(street)
    assert sorted(asked) == ["RX0", "RX1", "RX2", "RX3"]
    assert again.mpcs["position"].values.tolist() == measured(street, 0.0)["position"].values.tolist()
    assert again.snr.shape == (again.mpcs.sizes["mpc"],)
