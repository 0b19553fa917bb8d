"""Streets of two walls with receivers at random places."""

import numpy as np
import xarray as xr

import erm


def street(count: int = 12, seed: int = 1) -> xr.Dataset:
    """Paths of receivers in a street with two walls, to 0.1 ns and 0.5 degrees."""
    rng = np.random.default_rng(seed)
    walls = erm.Environment.walls([[[-60, 10], [60, 10]], [[-60, -12], [60, -12]]], top=40.0)
    receivers = np.column_stack([rng.uniform(8, 50, count), rng.uniform(-9, 8, count), np.full(count, 1.5)])
    table = xr.concat([erm.predict(walls, (0, 0, 9), rx, 132e9) for rx in receivers], dim="mpc")
    return noisy(table, rng)


def noisy(table: xr.Dataset, rng: np.random.Generator) -> xr.Dataset:
    """Add errors of 0.1 ns and 0.5 degrees, and say so."""
    n = table.sizes["mpc"]
    return table.assign(
        delay=table["delay"] + 1e-10 * rng.standard_normal(n),
        azimuth=table["azimuth"] + 0.5 * rng.standard_normal(n),
        delay_std=("mpc", np.full(n, 1e-10)),
        azimuth_std=("mpc", np.full(n, 0.5)),
    )
