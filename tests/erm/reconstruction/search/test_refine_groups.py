"""Which paths a line collects."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.reconstruction.model.line import seed_lines
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.search.images import Images
from erm.reconstruction.search.refine_groups import collect_inliers


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_of_two_paths_of_a_link_the_denser_one_is_taken(order):
    # both have the gain of the wall; one is an error off, the other has no error and says that it may be 100 times it
    street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    true = erm.predict(street, (0, 0, 9), (20, -4, 2), 132e9).isel(mpc=[1])
    sure = true.assign(delay=true["delay"] + 1e-10, delay_std=("mpc", [1e-10]), azimuth_std=("mpc", [0.5]))
    vague = true.assign(delay_std=("mpc", [1e-8]), azimuth_std=("mpc", [50.0]))
    wall = true.assign(delay_std=("mpc", [1e-12]), azimuth_std=("mpc", [0.01]))
    paths = Paths.from_table(erm.select(xr.concat([(sure, vague)[at] for at in order], dim="mpc")))
    lines = seed_lines(Paths.from_table(erm.select(wall)))
    collected, _ = collect_inliers(Images(paths), lines, np.ones(2, dtype=bool))
    assert collected.rows.tolist() == [order.index(0)]
