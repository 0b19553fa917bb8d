"""Noise floors follow the gain settings: what does not, is wrong."""

import numpy as np
import pytest

from sounder.cir.power_spectrum import noise_power
from sounder.quality.noise_floor import NoiseFloors, floor_std

ORDER = np.arange(108)


def floors(seed, std=0.3):
    return -150 + std * np.random.default_rng(seed).normal(size=108)


def test_the_standard_deviation_of_a_floor_is_that_of_its_quantile():
    powers = np.random.default_rng(1).exponential(size=(4000, 500))
    measured = np.std(10 * np.log10(noise_power(powers)))
    assert floor_std(np.ones(500)) == pytest.approx(measured, rel=0.05)  # 4000 give 1 %; 500 delays are not many


def test_clean_floors_are_within_the_bound():
    outside = [
        np.abs(NoiseFloors.of(floors(seed), np.zeros(108), ORDER, 0.3).excess).max() > 1.4 for seed in range(200)
    ]
    assert sum(outside) <= 3


def test_a_gain_that_falls_during_the_scan_is_measured():
    found = NoiseFloors.of(floors(2) - 3 * ORDER / 107, np.zeros(108), ORDER, 0.3)
    assert found.fall == pytest.approx(-3, abs=0.5)  # 0.1 dB is the error of a fit to all floors
    assert np.abs(found.excess).max() < found.bound


def test_gains_of_the_wrong_sign_are_found_whatever_a_tenth_of_the_directions_does():
    rng = np.random.default_rng(3)
    gain = rng.integers(0, 20, 108).astype(float)
    floor = floors(4)
    floor[::10] += 20
    assert NoiseFloors.of(floor, gain, ORDER, 0.3).sign == 1
    assert NoiseFloors.of(floor - 2 * gain, gain, ORDER, 0.3).sign == -1


def test_a_tenth_of_the_directions_is_no_trend():
    floor = floors(5)
    floor[-11:] += 20
    found = NoiseFloors.of(floor, np.zeros(108), ORDER, 0.3)
    assert found.fall == 0
    assert np.flatnonzero(found.excess > found.bound).tolist() == list(range(97, 108))
