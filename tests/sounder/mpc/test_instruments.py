"""Other horns, scans and sequences give the same paths."""

import numpy as np
import pytest

from sounder.instrument.antenna_description import Antenna

from .extraction import GAUSSIAN, mpcs, strong, turn


@pytest.mark.slow
def test_gaussian_horn(bench_maker, description):
    bench = bench_maker(description(rx_antenna=GAUSSIAN), seed=2)
    rng = np.random.default_rng(11)
    for seed in range(10):
        path = -100.0, rng.uniform(30e-9, 840e-9), rng.uniform(0, 360), rng.uniform(-11, 11)
        table = strong(mpcs(bench, [path], seed=seed))
        assert table.sizes["mpc"] == 1
        assert abs(turn(table["azimuth"][0], path[2])) < 1e-3
        assert abs(table["elevation"][0] - path[3]) < 1e-3
        assert abs(table["path_gain"][0] - path[0]) < 0.01


def test_one_elevation_leaves_the_elevation_open(bench_maker, description):
    bench = bench_maker(description(scan={"elevation": (0.0,)}))
    table = strong(mpcs(bench, [(-100.0, 200e-9, 123.4, 0.0)]))
    assert table.sizes["mpc"] == 1
    assert np.isnan(table["elevation"]).all()
    assert np.isnan(table["elevation_std"]).all()
    assert table["azimuth"][0] == pytest.approx(123.4, abs=1e-3)
    assert table["path_gain"][0] == pytest.approx(-100.0, abs=0.01)


def test_one_azimuth_gives_the_direction_looked_at(bench_maker, description):
    bench = bench_maker(description(scan={"azimuth": (40.0,)}))
    table = strong(mpcs(bench, [(-100.0, 200e-9, 40.0, 3.0)]))
    assert table.sizes["mpc"] == 1
    assert table["azimuth"][0] == 40.0
    assert np.isnan(table["azimuth_std"]).all()
    assert table["elevation"][0] == pytest.approx(3.0, abs=1e-3)


def test_antenna_without_directivity(bench_maker, description):
    flat = {"pattern": "flat", "cut": None, "gain": 2.0}
    bench = bench_maker(description(rx_antenna=flat, scan={"azimuth": (0.0,), "elevation": (0.0,)}))
    table = strong(mpcs(bench, [(-100.0, 200e-9, 77.0, 5.0), (-110.0, 240e-9, 7.0, 5.0)]))
    np.testing.assert_allclose(table["path_gain"], [-100.0, -110.0], atol=0.01)
    np.testing.assert_allclose(table["delay"], [200e-9, 240e-9], atol=3e-12)


def test_relative_gain_of_an_antenna_is_removed(description, bench_maker):
    antenna = Antenna(gain=10.0, hpbw_azimuth=30, hpbw_elevation=30)
    bench = bench_maker(description(rx_antenna=antenna.model_dump()))
    table = strong(mpcs(bench, [(-90.0, 200e-9, 44.0, 0.0)]))
    assert table["path_gain"][0] == pytest.approx(-90.0, abs=0.05)


@pytest.mark.slow
def test_a_sector_is_no_circle(bench_maker, description):
    """The ends of 20..160 degree are not neighbours; 3 degree beyond them the main lobe still sees."""
    bench = bench_maker(description(scan={"azimuth": tuple(np.arange(20.0, 161.0, 10.0))}))
    rng = np.random.default_rng(12)
    for seed in range(15):
        path = -100.0, rng.uniform(30e-9, 840e-9), rng.uniform(17, 163), rng.uniform(-9, 9)
        table = strong(mpcs(bench, [path], seed=seed))
        assert table.sizes["mpc"] == 1
        assert table["azimuth"][0] == pytest.approx(path[2], abs=1e-2)
        assert table["path_gain"][0] == pytest.approx(path[0], abs=0.05)


def test_missing_directions_are_no_data(bench):
    cir = bench.scan([(-100.0, 200e-9, 42.0, 1.0)], noise=-150.0)
    cir["cir"][5:, 0] = np.nan
    cir["cir"][20, 1] = np.nan
    table = strong(mpcs(bench, [], scan=cir))
    assert table.sizes["mpc"] == 1
    assert table["azimuth"][0] == pytest.approx(42.0, abs=0.1)
    assert table["elevation"][0] == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("order", "polynomial", "per_chip"), [(7, (7, 1, 0), 1), (10, (10, 3, 0), 3)])
@pytest.mark.slow
def test_other_sequences_and_rates(bench_maker, description, order, polynomial, per_chip):
    waveform = {"order": order, "polynomial": polynomial, "samples_per_chip": per_chip, "sample_rate": 600e6 * per_chip}
    bench = bench_maker(description(waveform=waveform, processing={"bandwidth": None}), seed=3)
    period = bench.sounder.waveform.period
    rng = np.random.default_rng(13)
    for seed in range(10):
        path = -100.0, rng.uniform(10e-9, period), rng.uniform(0, 360), rng.uniform(-9, 9)
        table = strong(mpcs(bench, [path], seed=seed), below=40.0)
        assert table.sizes["mpc"] == 1, (path, table.to_dataframe())
        assert abs(table["delay"][0] - path[1]) < 10e-12
        assert abs(turn(table["azimuth"][0], path[2])) < 0.05
        assert abs(table["path_gain"][0] - path[0]) < 0.05
