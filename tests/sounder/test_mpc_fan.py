"""Paths above and below the fan, which no main lobe sees: what the sidelobes of all beams tell of them."""

import numpy as np
import pytest

from sounder.mpc import extract

HORN = 24.5


def turn(a, b):
    return (a - b + 180) % 360 - 180


@pytest.mark.parametrize(("step", "draws"), [(10.0, 14), (2.5, 4)])
def test_a_path_far_above_the_fan_is_one_mpc_with_its_gain(bench_maker, description, step, draws):
    """From 19.5 degree up, 20 dB and more under boresight, its neighbours fit a path in the fan as well, 20 dB weaker.

    But that would not enter through the sidelobes of a hundred beams, 10 dB over the noise here; nor do these make
    paths of their own.
    """
    bench = bench_maker(description(scan={"azimuth": tuple(np.arange(0.0, 360.0, step))}), seed=5)
    rng = np.random.default_rng(31)
    for seed in range(draws):
        elevation = rng.choice([-1, 1]) * rng.uniform(19.5, 24)
        path = -100.0, rng.uniform(30e-9, 800e-9), rng.uniform(0, 360), elevation
        table = extract(bench.scan([path], noise=-100 + HORN - 50, seed=seed), bench.filter_, bench.sounder)
        assert table.sizes["mpc"] == 1, (seed, path)
        row = table.isel(mpc=0)
        assert abs(turn(row["azimuth"], path[2])) < 1, (seed, path)
        # sidelobes turn between 20 and 24 degree, so that several elevations have one gain
        assert abs(row["elevation"] - elevation) < max(4 * row["elevation_std"], 4), (seed, path)
        assert abs(row["path_gain"] - path[0]) < max(4 * row["path_gain_std"], 4), (seed, path)
