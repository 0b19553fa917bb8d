"""Paths that met the ground besides show walls a second time."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.maps.environment import Slab
from erm.reconstruction.rounds import reconstruct_survey
from erm.survey.bundle import SurveyStd


@pytest.mark.slow
def test_ways_by_the_ground_make_walls_and_positions_more_certain():
    street = erm.Environment.walls([[[-60, 10], [80, 10]]], top=40.0, ground=Slab(0.0))
    rng = np.random.default_rng(3)
    links = []
    for number, east in enumerate(np.linspace(10, 60, 6)):
        rx = np.array([east, rng.uniform(-5, 5), 2.0])
        link = erm.predict(street, (0, 0, 9), rx, 132e9, max_order=2)
        moved = np.tile([*rx[:2] + 0.2 * rng.standard_normal(2), 2.0], (link.sizes["mpc"], 1))
        name = np.full(link.sizes["mpc"], f"RX{number}")
        links.append(link.assign(position=("mpc", name), rx_position=(("mpc", "xyz"), moved)))
    table = xr.concat(links, dim="mpc")
    count = table.sizes["mpc"]
    table = table.assign(
        delay=table["delay"] + 1e-10 * rng.standard_normal(count),
        azimuth=table["azimuth"] + 0.5 * rng.standard_normal(count),
        delay_std=("mpc", np.full(count, 1e-10)),
        azimuth_std=("mpc", np.full(count, 0.5)),
    )
    given = SurveyStd(0.2, 0.0, 0.0)
    direct = np.isclose(table["azimuth"], np.rad2deg(np.arctan2(0, -1)), atol=20)
    found = {}
    for name, kept in (("all", np.ones(count, dtype=bool)), ("without", (table["elevation"] > 0) | direct)):
        environment, located = reconstruct_survey(table.isel(mpc=np.flatnonzero(kept)), given, common=False)
        faces = environment.reflectors.isel(reflector=environment.reflectors["kind"].values == "wall")
        found[name] = np.mean(located["survey_rx_std"]), np.sqrt(faces["covariance"].values[0, 1, 1])
    # two measurements of each azimuth and length; a ground that may be off by a decimetre takes from the latter
    assert found["all"][0] < 0.95 * found["without"][0]
    assert found["all"][1] < 0.99 * found["without"][1]
