"""A facade of piers and recessed panes is one wall on the mean of what it reflected; a smooth or stepped one is not."""

import numpy as np
import pytest
import xarray as xr

import erm

TX, FREQUENCY = (-20.0, -4.0, 6.0), 60e9


def measured(ends, seed, delay_std=0.1, azimuth_std=0.5):
    """Selected MPCs of receivers along parts of a facade, and their reflection points."""
    rng = np.random.default_rng(seed)
    place = erm.Environment.walls(ends, top=12.0)
    links, points = [], []
    for number, east in enumerate(np.linspace(-15, 15, 24)):
        rx = np.array([east, rng.uniform(-8, 0), 1.5])
        points.append(erm.trace(place, TX, rx, FREQUENCY, max_order=1).isel(path=slice(1, None)).vertices.values[:, 0])
        link = erm.predict(place, TX, rx, FREQUENCY, max_order=1)
        count = link.sizes["mpc"]
        link["position"] = ("mpc", np.full(count, f"P{number}"))
        link["delay"] = link["delay"] + delay_std * 1e-9 * rng.standard_normal(count)
        link["azimuth"] = link["azimuth"] + azimuth_std * rng.standard_normal(count)
        if delay_std:
            link["delay_std"] = ("mpc", np.full(count, delay_std * 1e-9))
            link["azimuth_std"] = ("mpc", np.full(count, azimuth_std))
        links.append(link)
    return erm.select(xr.concat(links, dim="mpc")), np.concatenate(points)


def parts(recess):
    """Piers of 1.2 m and panes of 1.8 m, a number from 0 to 1 of the recess deep, that face south."""
    starts = np.arange(-30, 30, 3.0)
    edges = [[(a, a + 1.2, 0.0), (a + 1.2, a + 3.0, recess)] for a in starts]
    return np.array([[[a, 10 + y], [b, 10 + y]] for pair in edges for a, b, y in pair])


@pytest.mark.slow
@pytest.mark.parametrize("exact", [True, False])
def test_piers_and_panes_are_one_facade(exact):
    table, points = measured(parts(0.25), 4, *((0.0, 0.0) if exact else (0.1, 0.5)))
    found = erm.reconstruct(table)[0].reflectors
    assert found.sizes["reflector"] == 1
    north = points[:, 1]
    # all reflection points count alike, but those that few beams see more exactly
    assert -found.offset.values[0] == pytest.approx(north.mean(), abs=0.25 * np.std(north))
    assert found.relief.values[0] == pytest.approx(np.std(north), rel=0.25)
    # the scatter of the parts is in the error of the facade
    assert found.covariance.values[0, 1, 1] > 0.5 * np.var(north) / len(north)


@pytest.mark.slow
@pytest.mark.parametrize("setback", [0.0, 0.3])
def test_smooth_and_stepped_facades_have_no_relief(setback):
    table, _ = measured(np.array([[[-30, 10.0], [-10, 10.0]], [[-10, 10 + setback], [30, 10 + setback]]]), 5)
    found = erm.reconstruct(table)[0].reflectors
    assert found.sizes["reflector"] == (2 if setback else 1)
    assert np.isnan(found.relief.values).all()


@pytest.mark.slow
def test_biased_paths_of_a_facade_make_no_second_one_behind_it():
    """Three neighbours are late by 20 standard deviations; three other links have such a path beside their own."""
    table, _ = measured(np.array([[[-30, 10.0], [30, 10.0]]]), 6, 0.01, 0.1)
    number = np.array([int(name[1:]) for name in table["position"].values])
    late = np.where(np.isin(number, (10, 11, 12)), 0.2e-9, 0.0)
    beside = table.isel(mpc=np.isin(number, (5, 15, 20)))
    beside["delay"] = beside["delay"] + 0.2e-9
    table["delay"] = table["delay"] + late
    found = erm.reconstruct(xr.concat([table, beside], dim="mpc"))[0].reflectors
    assert found.sizes["reflector"] == 1
    assert found.offset.values[0] == pytest.approx(-10, abs=0.01)
