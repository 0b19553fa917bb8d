"""What contradicts in a table is said."""

import numpy as np
import xarray as xr

import erm
from erm.survey.calibration import Calibration
from erm.survey.report import remarks

NOTHING_WRONG = Calibration(0.0, 0.0, 0.0, np.zeros((3, 3)), ambiguous=(), direct_paths=0, images=0)


def test_a_clock_that_nothing_shows_is_said_with_what_it_does_to_walls():
    street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    located = erm.select(erm.predict(street, (0, 0, 9), (10, -4, 2), 132e9)).assign_attrs(adjusted_clock=1e-9)
    unknown = Calibration(0.0, 1e-9, 0.0, np.diag([0.1, 1e-9, 1.0]) ** 2, ambiguous=("clock",), images=2)
    [line] = remarks(located, unknown)
    assert "the common error of the clock, 1.00 ± 1.00 ns: all paths may be too long or too short by 0.30 m" in line
    assert remarks(located, NOTHING_WRONG) == []


def test_two_carriers_on_one_map_are_said():
    street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)

    def located(*carriers: float) -> xr.Dataset:
        links = [erm.predict(street, (0, 0, 9), (10 + k, -4, 2), carrier) for k, carrier in enumerate(carriers)]
        links = [link.assign(position=("mpc", [f"P{k}"] * link.sizes["mpc"])) for k, link in enumerate(links)]
        return erm.select(xr.concat(links, dim="mpc"))

    assert remarks(located(28e9, 28e9), NOTHING_WRONG) == []
    [line] = remarks(located(28e9, 132e9, 28e9), NOTHING_WRONG)
    assert "MPCs of 2 carriers are on one map: 132 GHz (1 position), 28 GHz (2 positions)" in line
