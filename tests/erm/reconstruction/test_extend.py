"""A map to which positions are added is the map of all of them."""

import numpy as np
import pytest
import xarray as xr

from erm.common.errors import DataError
from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.mpcs.selection import select
from erm.mpcs.table import make_table
from erm.reconstruction.extend import add_mpcs, read_map_mpcs, with_images
from erm.reconstruction.reconstruct import reconstruct
from erm.reconstruction.search.search import NEW_MPC
from erm.tracing.trace import trace

FREQUENCY, TX = 132e9, np.array([3.0, -4.0, 9.0])
ENDS = [[[-5, 12], [70, 12]], [[70, 16], [70, -15]], [[-12, -15], [-12, 14]], [[-5, -9], [60, -9]]]
COURT = Environment.walls(np.array(ENDS, dtype=float), top=12.0, material="concrete")
DELAY_STD, AZIMUTH_STD = 20e-12, 0.2  # s, degree


@pytest.fixture(scope="module")
def campaign():
    """Paths of up to two reflections at 25 places, with errors."""
    rng = np.random.default_rng(7)
    parts = []
    for number in range(25):
        rx = np.array([rng.uniform(5, 60), rng.uniform(-7, 10), 1.5])
        paths = trace(COURT, TX, rx, FREQUENCY, max_order=2)
        n = paths.sizes["path"]
        measured = {
            "delay": paths["delay"].values + DELAY_STD * rng.standard_normal(n),
            "azimuth": paths["azimuth"].values + AZIMUTH_STD * rng.standard_normal(n),
            "elevation": paths["elevation"].values,
            "path_gain": paths["path_gain"].values,
        }
        errors = {"delay_std": DELAY_STD, "azimuth_std": AZIMUTH_STD, "elevation_std": 0.2, "path_gain_std": 0.5}
        ends = {"position": f"RX{number}", "tx_position": TX, "rx_position": rx, "frequency": FREQUENCY}
        parts.append(make_table(ends | measured | errors))
    return parts


@pytest.mark.slow
def test_positions_added_to_a_map_give_the_map_of_all(campaign):
    before = xr.concat(campaign[:20], dim="mpc")
    _, earlier = reconstruct(select(before))
    table, start = add_mpcs(before, earlier["image"].values, xr.concat(campaign[20:], dim="mpc"))
    grown, located = reconstruct(select(table), start=start)
    again, expected = reconstruct(select(table))
    assert again.reflectors.sizes["reflector"] == 4
    # errors are estimated from the residuals to 10 % (see `search_groups`), so covariances agree to 20 %, and values
    # that are weighted by them to a small part of the errors
    for name, share in (("normal", 0), ("offset", 1)):
        sigma = np.sqrt(again.reflectors["covariance"].values[:, share, share])
        assert (np.abs(grown.reflectors[name] - again.reflectors[name]).values < 0.2 * sigma).all()
    np.testing.assert_allclose(grown.reflectors["covariance"], again.reflectors["covariance"], rtol=0.25)
    np.testing.assert_allclose(grown.reflectors["end_points"], again.reflectors["end_points"], atol=0.01)
    np.testing.assert_array_equal(located["wall"], expected["wall"])


@pytest.mark.slow
def test_walls_that_an_added_position_does_not_see_stay(campaign):
    before = xr.concat(campaign[:20], dim="mpc")
    expected, earlier = reconstruct(select(before))
    direct = campaign[20].isel(mpc=[int(np.argmin(campaign[20]["delay"].values))])
    table, start = add_mpcs(before, earlier["image"].values, direct)
    grown, located = reconstruct(select(table), start=start)
    np.testing.assert_array_equal(located["wall"].values, np.append(earlier["wall"], -1))
    np.testing.assert_allclose(grown.reflectors["end_points"], expected.reflectors["end_points"], atol=0.01)


@pytest.mark.slow
def test_a_map_file_holds_the_mpcs_that_it_was_made_from(campaign, tmp_path):
    before = xr.concat(campaign[:8], dim="mpc")
    environment, located = reconstruct(select(before))
    write_map(environment, tmp_path / "map.h5", mpcs=with_images(before, located))
    stored, image = read_map_mpcs(tmp_path / "map.h5")
    np.testing.assert_array_equal(image, located["image"])
    for name in stored:
        np.testing.assert_array_equal(stored[name].values, before[name].values)
    assert read_map(tmp_path / "map.h5").reflectors.sizes == environment.reflectors.sizes


@pytest.mark.slow
def test_a_position_measured_again_replaces_the_old_one(campaign):
    before = xr.concat(campaign[:8], dim="mpc")
    table, start = add_mpcs(before, np.arange(before.sizes["mpc"]), campaign[3])
    assert table.sizes["mpc"] == before.sizes["mpc"]
    np.testing.assert_array_equal(start == NEW_MPC, table["position"] == "RX3")


def test_a_map_without_mpcs_says_what_to_do(tmp_path):
    write_map(COURT, tmp_path / "drawn.h5")
    with pytest.raises(DataError, match="holds no MPCs; expected a map that `erm reconstruct`"):
        read_map_mpcs(tmp_path / "drawn.h5")
    write_map(COURT, tmp_path / "drawn.geojson")
    with pytest.raises(DataError, match="maps of this format hold no MPCs"):
        read_map_mpcs(tmp_path / "drawn.geojson")
    with pytest.raises(DataError, match="no such file"):
        read_map_mpcs(tmp_path / "absent.h5")
