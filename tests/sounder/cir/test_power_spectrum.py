"""Power over angle and delay, its noise floor, and the profiles made from it."""

import numpy as np
import pytest
import xarray as xr

from sounder.cir.false_alarm import false_alarm_level
from sounder.cir.power_spectrum import daps, looks_of, noise_power

PATH = -100.0, 240 / 1.2e9, 40.0, 0.0  # on a sample, in the middle of a beam
HORN = 24.5


def test_noise_floor_of_noise_is_its_mean():
    """A quantile q of N exponential variables over -ln(1 - q) is biased by 1/N and spreads by sqrt(q/(1-q)/N) of it."""
    rng = np.random.default_rng(1)
    power = rng.exponential(3.0, (400, 1022))
    floor = noise_power(power)
    spread = np.sqrt(0.25 / 0.75 / 1022) / -np.log(0.75)  # 6.3 %
    assert floor.mean() == pytest.approx(3.0, rel=4 * spread / np.sqrt(400) + 1 / 1022)
    assert floor.std() == pytest.approx(3.0 * spread, rel=0.15)  # 400 values tell a deviation to 3.5 %


def test_noise_floor_of_de_embedded_noise_is_its_mean(bench):
    noise = bench.noise(np.random.default_rng(2), 400)
    # neighbouring samples are correlated: about 450 independent ones, 9.5 % a direction, 0.5 % in the mean of 400
    assert noise_power(np.abs(noise) ** 2).mean() == pytest.approx(1.0, rel=0.02)


def test_paths_in_half_of_the_delays_hardly_move_the_noise_floor():
    """With a share s of the delays taken, the quantile is that of q / (1 - s) of the noise: 3.8 dB at half."""
    rng = np.random.default_rng(3)
    power = rng.exponential(1.0, (200, 1022))
    power[:, :102] += 1e6
    expected = np.log(1 - 0.25 / 0.9) / np.log(0.75)
    assert noise_power(power).mean() == pytest.approx(expected, rel=0.02)
    assert 10 * np.log10(expected) < 0.6


def test_floor_of_every_direction_is_its_own(bench):
    cir = bench.scan([PATH], noise=-150.0, seed=4)
    cir["cir"][7] *= 10.0
    floor = daps(cir, bench.sounder)["noise_floor"]
    others = np.delete(np.arange(36), 7)
    # 9.5 % a direction is 0.4 dB; four deviations of 108 directions
    np.testing.assert_allclose(floor[others], -150.0, atol=1.8)
    np.testing.assert_allclose(floor[7], -130.0, atol=1.8)


def test_daps_is_the_path_gain_with_the_horn(bench):
    product = daps(bench.scan([PATH]), bench.sounder)
    assert float(product["daps"].max()) == pytest.approx(-100.0 + HORN, abs=1e-3)
    peak = product["daps"].where(product["daps"] == product["daps"].max(), drop=True)
    assert (float(peak["azimuth"][0]), float(peak["elevation"][0])) == (40.0, 0.0)
    assert float(peak["delay"][0]) == pytest.approx(PATH[1], abs=1e-15)
    assert product["daps"].attrs["units"] == "dB"


def test_turning_the_scan_turns_the_daps(bench):
    cir = bench.scan([PATH, (-110.0, 301e-9, 333.0, 5.0)], noise=-140.0, seed=5)
    straight = daps(cir, bench.sounder)
    for beams in (1, 17, 35):
        turned = daps(cir.copy(data={"cir": np.roll(cir["cir"].values, beams, axis=0)}), bench.sounder)
        for name in ("daps", "noise_floor", "pas"):
            assert np.array_equal(turned[name], np.roll(straight[name], beams, axis=0))
        np.testing.assert_allclose(turned["pdp"], straight["pdp"], atol=1e-9)


@pytest.mark.parametrize("offset", [0.0, 2.5, 5.0])
def test_omnidirectional_profile_of_a_path_is_its_gain(bench, offset):
    """Summed power over all beams hardly depends on where between the beams a path comes from."""
    cir = bench.scan([(-100.0, PATH[1], 40.0 + offset, 0.0)])
    summed = float(daps(cir, bench.sounder)["pdp"].max())
    # Beams of 10 degree every 10 degree: the sum over azimuth of a lobe of 10 degree at half power ripples by 0.6 dB
    # (1 + 2/16 on a beam, 2/2 between). The correction averages over the scan's elevations: the middle beam has two
    # neighbours and an outer one has one, 12 dB down: 0.2 dB more.
    assert summed == pytest.approx(-100.0, abs=0.8)
    strongest = float(daps(cir, bench.sounder, omnidirectional="maximum")["pdp"].max())
    # the strongest beam loses what the horn loses off boresight, 3 dB halfway
    assert strongest == pytest.approx(-100.0 - 12 * (offset / 10) ** 2, abs=0.1)


@pytest.mark.parametrize("azimuth", [0.0, 40.0])
def test_omnidirectional_profile_is_right_in_the_mean_over_the_scan(bench, azimuth):
    """The beams' overlap is taken out as it is over the directions looked at; alike at every azimuth of a circle."""
    linear = []
    for elevation in (-9.0, 0.0, 9.0):
        product = daps(bench.scan([(-100.0, PATH[1], azimuth, elevation)]), bench.sounder)
        linear.append(10 ** (float(product["pdp"].max()) / 10))
    # the peak of the pulse at a sample is known to the CIR's rounding in complex64
    assert 10 * np.log10(np.mean(linear)) == pytest.approx(-100.0, abs=1e-3)


def test_maximum_profile_of_a_single_beam_is_its_daps(bench_maker, description):
    single = bench_maker(description(scan={"azimuth": (40.0,), "elevation": (0.0,)}))
    for how in ("sum", "maximum"):
        product = daps(single.scan([PATH], noise=-150.0), single.sounder, omnidirectional=how)
        np.testing.assert_allclose(product["pdp"], product["daps"][0, 0] - HORN, atol=1e-4)
        assert product.attrs["omnidirectional"] == how


def test_angular_spectrum_adds_the_power_over_delay(bench):
    first, second = PATH, (-103.0, 480 / 1.2e9, 40.0, 0.0)
    alone, other, both = (
        float(daps(bench.scan(paths, noise=-150.0), bench.sounder)["pas"].sel(azimuth=40, elevation=0))
        for paths in ([first], [second], [first, second])
    )
    # The pulse is several samples wide; 50 dB over the noise its energy is known to 0.3 %, far sidelobes add less.
    assert other - alone == pytest.approx(-3.0, abs=0.02)
    assert both == pytest.approx(10 * np.log10(10 ** (alone / 10) + 10 ** (other / 10)), abs=0.02)
    energy = 10 * np.log10(np.sum(np.abs(bench.filter_.pulse) ** 2))
    assert alone == pytest.approx(-100.0 + HORN + energy, abs=0.02)


def test_angular_spectrum_of_noise_is_far_below_its_power(bench):
    """6 dB over the floor, exp(-4) of the noise's samples remain, with (1 + 4) exp(-4) of its power: 9 %."""
    product = daps(bench.scan([], noise=-150.0, seed=6), bench.sounder)
    share = np.mean(10 ** (product["pas"].values / 10)) / (1022 * 1e-15)
    # the floor of a direction is known to 9.5 %, which moves 5 exp(-4) by some 25 % either way; the mean of 108 to 5 %
    assert share == pytest.approx(5 * np.exp(-4), rel=0.2)


@pytest.mark.parametrize("how", ["sum", "maximum"])
def test_missing_directions_stay_missing(bench, how):
    cir = bench.scan([PATH], noise=-150.0)
    whole = daps(cir, bench.sounder, omnidirectional=how)
    cir["cir"][10:] = np.nan
    part = daps(cir, bench.sounder, omnidirectional=how)
    for name in ("daps", "noise_floor", "pas"):
        assert np.isnan(part[name][10:]).all()
        np.testing.assert_array_equal(part[name][:10], whole[name][:10])
    # the sum is corrected for the beams that are there: a sector has edges, with one neighbour less
    assert float(part["pdp"].max()) == pytest.approx(float(whole["pdp"].max()), abs=0.3)


def test_silence_has_no_level(bench):
    product = daps(bench.dataset(np.zeros((36, 3, 1022), np.complex64)), bench.sounder)
    for name in ("daps", "noise_floor", "pdp", "pas"):
        assert np.isneginf(product[name]).all()


@pytest.mark.parametrize("independent", [12, 48, 192])
def test_looks_are_the_independent_noise_powers_not_the_snapshots(independent):
    """192 snapshots, of which some repeat others: the floor is the mean, and noise exceeds the level as it should.

    The ratio of the quantiles of a direction has a standard deviation of 30 % of the looks, the median of 100 one of
    4 %.
    """
    rng = np.random.default_rng(5)
    power = rng.gamma(independent, 1 / independent, (100, 1, 1022))
    cir = xr.Dataset(
        {"cir": (("azimuth", "elevation", "delay"), np.sqrt(power))}, attrs={"averaging": "power", "snapshots": 192}
    )
    looks = looks_of(cir)
    assert looks == pytest.approx(independent, rel=0.16)
    assert noise_power(power, looks).mean() == pytest.approx(1.0, abs=0.005)
    level = false_alarm_level(0.05, power.size, 1022, looks)
    assert np.sum(power > level * noise_power(power, looks)[..., None]) <= 2
    assert looks_of(cir.assign_attrs(averaging="coherent")) == 1
