"""Turning a channel, scaling its power or waiting changes no spread; errors are those of many noisy copies."""

import numpy as np
import pytest

from sounder.parameters.angles import angular_spread
from sounder.parameters.delay import maximum_excess_delay, mean_excess_delay, rms_delay_spread
from sounder.parameters.k_factor import k_strongest
from sounder.parameters.path_loss import path_loss

from .channels import COLUMNS, parameters, random_table, table

INVARIANT = (
    "rms_delay_spread", "mean_excess_delay", "maximum_excess_delay", "coherence_bandwidth", "azimuth_spread_arrival",
    "azimuth_spread_arrival_fleury", "zenith_spread_arrival", "k_strongest", "mpcs",
)  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_a_turned_louder_and_later_channel_has_the_same_parameters(seed):
    rng = np.random.default_rng(seed)
    mpcs = random_table(rng, int(rng.integers(2, 40)), std=(0.1e-9, 0.5, 0.5, 0.3))
    angle, gain, later = rng.uniform(0, 360), rng.uniform(-40, 40), rng.uniform(0, 1e-6)
    moved = mpcs.assign(azimuth=(mpcs["azimuth"] + angle) % 360, path_gain=mpcs["path_gain"] + gain)
    before, after = parameters(mpcs), parameters(moved.assign(delay=mpcs["delay"] + later))
    for name in INVARIANT:
        assert float(after[name]) == pytest.approx(float(before[name]), rel=1e-7), name
        if f"{name}_std" in before:
            std = float(before[f"{name}_std"])
            assert float(after[f"{name}_std"]) == pytest.approx(std, rel=1e-4, nan_ok=True), name
    assert float(after["path_loss"] - before["path_loss"]) == pytest.approx(-gain)


@pytest.mark.parametrize("seed", range(3))
def test_the_errors_are_those_of_noisy_copies(seed):
    rng = np.random.default_rng(seed)
    std = np.array([0.3e-9, 1.0, 0.5, 0.4])
    mpcs = random_table(rng, 8, std=std)
    mpcs["path_gain"][0] = -97.0  # no other path becomes the strongest: there K has a kink
    stated = parameters(mpcs)
    noisy = (mpcs[name].values + one * rng.normal(size=(1000, 8)) for name, one in zip(COLUMNS, std, strict=True))
    delay, azimuth, elevation, gain = noisy
    power = 10 ** (gain / 10)
    copies = {
        "path_loss": path_loss(power),
        "rms_delay_spread": rms_delay_spread(delay, power),
        "mean_excess_delay": mean_excess_delay(delay, power),
        "maximum_excess_delay": maximum_excess_delay(delay, power),
        "azimuth_spread_arrival": angular_spread(azimuth, power),
        "azimuth_spread_arrival_fleury": angular_spread(azimuth, power, "fleury"),
        "zenith_spread_arrival": angular_spread(elevation, power),
        "k_strongest": k_strongest(power),
    }
    for name, values in copies.items():
        # 1000 copies tell a deviation to 2.2 %; four of these, and a tenth for the curvature
        assert float(stated[f"{name}_std"]) == pytest.approx(values.std(), rel=0.19), name


def test_the_error_of_the_coherence_bandwidth_of_two_paths():
    """``B = arccos(1/2) / (pi T)`` has the relative error of ``T`` (Gauss)."""
    mpcs = table((100e-9, 0, 0, -100), (200e-9, 0, 0, -100), std=(0.5e-9, 0, 0, 0))
    result = parameters(mpcs)
    expected = float(result["coherence_bandwidth"]) * np.sqrt(2) * 0.5 / 100
    assert float(result["coherence_bandwidth_std"]) == pytest.approx(expected, rel=1e-3)


def test_a_clock_that_moves_all_delays_moves_no_spread():
    rng = np.random.default_rng(1)
    mpcs = random_table(rng, 6, std=(1e-9, 0.0, 0.0, 0.0)).assign(clock_std=("mpc", np.full(6, 1e-9)))
    result = parameters(mpcs)
    assert float(result["rms_delay_spread_std"]) == pytest.approx(0, abs=1e-15)
    assert float(parameters(mpcs.drop_vars("clock_std"))["rms_delay_spread_std"]) > 1e-10


def test_without_standard_deviations_there_are_no_errors():
    result = parameters(random_table(np.random.default_rng(2), 5))
    assert all(np.isnan(float(result[name])) for name in result.data_vars if name.endswith("_std"))
