"""A lamp post throws a path from one point to every receiver; walls and their roughness do not make poles."""

import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from erm.environment import Environment
from erm.geometry import azimuth_of
from erm.mpc_table import make_table
from erm.reconstruct import reconstruct
from erm.select import select
from erm.trace import trace

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 6.0])


def campaign(environment, seed=1, delay_std=3e-11, azimuth_std=0.2, count=12):
    """Table of all paths of receivers along a street."""
    rng = np.random.default_rng(seed)
    parts = []
    for east in np.linspace(15, 60, count):
        rx = np.array([east, rng.uniform(-2, 2), 1.5])
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


def test_a_wall_makes_no_poles():
    environment, _ = reconstruct(select(campaign(Environment.walls([[[0.0, 12.0], [70.0, 12.0]]], top=9.0))))
    assert set(environment.reflectors["kind"].values) == {"wall"}
