"""Curved faces: pillars, rounded corners and curved facades are found, planes stay planes, and chains are no faces."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.maps.environment import Environment

FREQUENCY = 60e9


def measured(place: Environment, seed: int, *, delay_std: float = 0.0, azimuth_std: float = 0.0, order: int = 1):
    """MPCs of thirty receivers, delays [ns] and azimuths [degree] with errors."""
    rng = np.random.default_rng(seed)
    links = []
    for number in range(30):
        rx = np.array([*rng.uniform(-9, 9, 2), 1.5])
        link = erm.predict(place, (1.0, 2.0, 3.0), rx, FREQUENCY, max_order=order)
        count = link.sizes["mpc"]
        link["position"] = ("mpc", np.full(count, f"P{number}"))
        link["delay"] = link["delay"] + delay_std * 1e-9 * rng.standard_normal(count)
        link["azimuth"] = link["azimuth"] + azimuth_std * rng.standard_normal(count)
        if delay_std:
            link["delay_std"] = ("mpc", np.full(count, delay_std * 1e-9))
            link["azimuth_std"] = ("mpc", np.full(count, azimuth_std))
        links.append(link)
    return erm.select(xr.concat(links, dim="mpc"))


@pytest.fixture(scope="module")
def courtyard() -> Environment:
    place = Environment.walls([[[-15.0, 14.0], [15.0, 14.0]]], top=9.0)
    place = place.with_arcs([[-20.0, 0.0], [30.0, 0.0]], [6.0, -45.0], [[-70, 70], [160, 200]], top=9.0)
    return place.with_poles([[5.0, -4.0]], 0.35, top=9.0)


@pytest.mark.slow
def test_exact_paths_give_exact_cylinders(courtyard):
    found, located = erm.reconstruct(measured(courtyard, 1))
    table = found.reflectors
    assert table.kind.values.tolist() == ["wall", "pole", "arc", "arc"]
    order = [1, *(2 + np.argsort(table.radius.values[2:])).tolist()]
    assert table.radius.values[order] == pytest.approx([0.35, -45.0, 6.0], rel=1e-4)
    truth = np.array([[5.0, -4.0], [30.0, 0.0], [-20.0, 0.0]])
    assert table.centre.values[order] == pytest.approx(truth, abs=0.01)
    single = located["order"].values == 1
    assert (located["wall"].values[single] >= 0).mean() > 0.95
    assert located["wall_point"].values[single & (located["wall"].values == 1), :2] == pytest.approx(
        np.broadcast_to([5.0, -4.0], (int(np.sum(located["wall"].values == 1)), 2)), abs=0.36
    )


@pytest.mark.slow
def test_radii_are_as_exact_as_they_say(courtyard):
    table = erm.reconstruct(measured(courtyard, 2, delay_std=0.1, azimuth_std=1.0))[0].reflectors
    for radius in (0.35, -45.0, 6.0):
        near = int(np.nanargmin(np.where(table.radius_std > 0, np.abs(table.radius / radius - 1), np.nan)))
        assert abs(table.radius.values[near] - radius) < 3 * table.radius_std.values[near]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_rooms_of_planes_get_no_cylinder(noise):
    corners = np.array([[-12.0, -11.0], [12.0, -11.0], [12.0, 13.0], [-12.0, 13.0]])
    room = Environment.walls(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), top=5.0)
    table = measured(room, 3, delay_std=noise, azimuth_std=10 * noise, order=2)
    assert set(erm.reconstruct(table)[0].reflectors.kind.values) == {"wall"}


@pytest.mark.slow
def test_chains_off_a_pillar_and_walls_are_no_pillars():
    place = Environment.walls([[[15.0, 12.0], [-15.0, 12.0]], [[-15.0, -12.0], [15.0, -12.0]]], top=9.0)
    place = place.with_poles([[5.0, -6.0]], 0.35, top=9.0)
    found = erm.reconstruct(measured(place, 6, delay_std=0.05, azimuth_std=0.3, order=2))[0].reflectors
    assert sorted(found.kind.values.tolist()) == ["pole", "wall", "wall"]
    assert found.centre.values[found.kind.values == "pole"] == pytest.approx(np.array([[5.0, -6.0]]), abs=0.1)
