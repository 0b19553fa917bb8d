"""A lamp post throws a path from one point to every receiver; walls and their roughness do not make poles."""

import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from erm.geometry.vertical import azimuth_of
from erm.maps.environment import Environment
from erm.mpcs.selection import select
from erm.mpcs.table import make_table
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 6.0])


def campaign(environment, seed=1, delay_std=3e-11, azimuth_std=0.2, count=12, north=(-2.0, 2.0)):
    """Table of all paths of receivers along a street."""
    rng = np.random.default_rng(seed)
    parts = []
    for east in np.linspace(15, 60, count):
        rx = np.array([east, rng.uniform(*north), 1.5])
        paths = trace(environment, TX, rx, FREQUENCY, max_order=1)
        n = paths.sizes["path"]
        parts.append(
            {
                "position": np.full(n, f"RX{east:.1f}"),
                "tx_position": np.tile(TX, (n, 1)),
                "rx_position": np.tile(rx, (n, 1)),
                "delay": paths.delay.values + delay_std * rng.standard_normal(n),
                "azimuth": paths.azimuth.values + azimuth_std * rng.standard_normal(n),
                "path_gain": paths.path_gain.values,
            }
        )
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    n = len(columns["delay"])
    errors = {"delay_std": np.full(n, delay_std), "azimuth_std": np.full(n, azimuth_std)}
    return make_table(columns | errors | {"frequency": FREQUENCY})


@pytest.mark.parametrize("seed", range(3))
def test_a_lamp_post_is_a_pole_where_it_stands(seed):
    post = np.array([[35.0, 9.0]])
    environment, merged = reconstruct(select(campaign(Environment.empty().with_poles(post, 0.12, top=8.0), seed)))
    table = environment.reflectors
    assert table["kind"].values.tolist() == ["pole"]
    # paths bounce off the surface, 0.12 m from the centre on sides that turn with the receiver
    assert np.linalg.norm(table["end_points"].values[0, 0] - post[0]) < 0.15
    assert table["radius"].item() == pytest.approx(0.12, rel=0.5)
    assert table["support"].item() >= 10
    assert (merged["wall"].values == 0).sum() == table["support"].item()


@pytest.mark.slow
def test_three_links_make_a_pole_where_little_else_is_and_none_in_a_crowd():
    post = np.array([[35.0, 9.0]])
    lonely = campaign(Environment.empty().with_poles(post, 0.12, top=8.0), seed=2, count=3)
    environment, _ = reconstruct(select(lonely))
    assert environment.reflectors["kind"].values.tolist() == ["pole"]
    assert np.linalg.norm(environment.reflectors["end_points"].values[0, 0] - post[0]) < 0.15
    # paths by way of points anywhere within 3 m of the post, as many that three of them meet by chance
    rng = np.random.default_rng(3)
    parts = [lonely]
    for _ in range(60):
        stray = lonely.copy(deep=True)
        place = post[0] + rng.uniform(-3, 3, (stray.sizes["mpc"], 2))
        tx, rx = stray["tx_position"].values, stray["rx_position"].values
        level = np.linalg.norm(place - tx[:, :2], axis=-1) + np.linalg.norm(place - rx[:, :2], axis=-1)
        stray["delay"][:] = np.hypot(level, tx[:, 2] - rx[:, 2]) / c
        stray["azimuth"][:] = azimuth_of(place - rx[:, :2])
        parts.append(stray)
    crowded, _ = reconstruct(select(xr.concat(parts, dim="mpc"), delay_window=1e-12, azimuth_window=1e-3))
    assert "pole" not in crowded.reflectors["kind"].values


def measured(length, seen, rx, loss, delay_std, azimuth_std, rng):
    """Table of paths of some lengths (path,) that arrive from vectors (path, 2), with errors drawn."""
    count = len(rx)
    return make_table(
        {
            "position": np.array([f"RX{one}" for one in rx[:, 0]]),
            "tx_position": np.tile(TX, (count, 1)),
            "rx_position": rx,
            "delay": length / c + delay_std * rng.standard_normal(count),
            "azimuth": azimuth_of(seen) + azimuth_std * rng.standard_normal(count),
            "path_gain": 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - loss,
            "delay_std": np.full(count, delay_std),
            "azimuth_std": np.full(count, azimuth_std),
            "frequency": FREQUENCY,
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_poles_that_stand_near_each_other_are_two(seed):
    posts = np.array([[35.0, 9.0], [36.5, 9.0]])
    environment, _ = reconstruct(select(campaign(Environment.empty().with_poles(posts, 0.12, top=8.0), seed)))
    found = environment.reflectors["end_points"].values[:, 0]
    assert len(found) == 2
    assert np.linalg.norm(found[np.argsort(found[:, 0])] - posts, axis=-1).max() < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_a_pole_is_one_although_some_of_its_paths_share_an_image(seed):
    # passed by on a straight line, half of a pole's paths point to one image within errors of 0.7 degrees
    scene = Environment.empty().with_poles([[50.0, 3.0]], 0.12, top=8.0)
    walk = campaign(scene, seed, delay_std=1e-10, azimuth_std=0.7, count=8, north=(1.0, 1.0))
    environment, _ = reconstruct(select(walk))
    assert environment.reflectors["kind"].values.tolist() == ["pole"]
    error = environment.reflectors["end_points"].values[0, 0] - [50.0, 3.0]
    # chi-squared of two degrees of freedom exceeds 13.8 once in a thousand draws
    assert error @ np.linalg.solve(environment.reflectors["centre_covariance"].values[0], error) < 13.8


@pytest.mark.parametrize("seed", range(5))
def test_an_image_seen_from_a_row_of_near_receivers_is_no_pole(seed):
    rng = np.random.default_rng(seed)
    rx = np.column_stack([20 + 1.5 * np.arange(4), np.zeros(4), np.full(4, 1.5)])
    seen = np.array([120.0, 60.0]) - rx[:, :2]
    length = np.hypot(np.linalg.norm(seen, axis=-1), TX[2] - 1.5)
    table = measured(length, seen, rx, 27.0 + rng.standard_normal(4), 3e-11, 0.5, rng)
    environment, _ = reconstruct(select(table))
    assert "pole" not in environment.reflectors["kind"].values


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 20))])
def test_a_rough_facade_makes_no_poles(seed):
    # 25 receivers see two places each on ten metres of a facade 0.4 m rough, with losses of any size
    rng = np.random.default_rng(seed)
    rx = np.column_stack([rng.uniform(10, 60, 25), rng.uniform(-8, 4, 25), np.full(25, 1.5)]).repeat(2, axis=0)
    places = np.column_stack([rng.uniform(30, 40, 50), 12 + 0.4 * rng.standard_normal(50), rng.uniform(1, 8, 50)])
    length = np.linalg.norm(places - TX, axis=-1) + np.linalg.norm(places - rx, axis=-1)
    table = measured(length, (places - rx)[:, :2], rx, rng.uniform(12, 32, 50), 1.7e-10, 1.5, rng)
    environment, _ = reconstruct(select(table))
    assert "pole" not in environment.reflectors["kind"].values


def test_a_pole_turns_with_the_scene_and_so_does_its_covariance():
    scene = Environment.empty().with_poles([[35.0, 9.0]], 0.12, top=8.0)
    table = campaign(scene, count=5)
    turned = table.copy(deep=True)
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    for end in ("tx_position", "rx_position"):
        turned[end][:] = table[end].values @ turn.T
    turned["azimuth"][:] = (table["azimuth"].values + np.rad2deg(np.arctan2(0.6, 0.8))) % 360
    here, there = (reconstruct(select(one))[0] for one in (table, turned))
    expected = here.moved(np.rad2deg(np.arctan2(0.6, 0.8)), (0.0, 0.0)).reflectors
    # steps of a fit end at a micrometre
    np.testing.assert_allclose(there.reflectors["end_points"], expected["end_points"], atol=1e-5)
    np.testing.assert_allclose(
        there.reflectors["centre_covariance"], expected["centre_covariance"], rtol=1e-3, atol=1e-9
    )
    assert there.reflectors["residual"].item() == pytest.approx(expected["residual"].item(), rel=1e-3)


def test_a_wall_makes_no_poles():
    environment, _ = reconstruct(select(campaign(Environment.walls([[[0.0, 12.0], [70.0, 12.0]]], top=9.0))))
    assert set(environment.reflectors["kind"].values) == {"wall"}
