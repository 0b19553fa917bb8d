"""Double-directional scans: angles of departure and arrival, and their errors against the Cramer-Rao bound."""

import numpy as np
import pytest
import xarray as xr

from sounder.instrument.antenna_pattern import Pattern
from sounder.mpc.extract import extract_mpcs
from sounder.mpc.pattern_slopes import Cuts, slopes

from ..conftest import describe

HORN = {
    "pattern": "gaussian",
    "cut": None,
    "gain": 0.0,
    "hpbw_azimuth": 12.0,
    "hpbw_elevation": 14.0,
    "sidelobe_floor": -25.0,
}
AXES = {
    "tx_azimuth": np.arange(-30, 31, 10.0),
    "tx_elevation": np.arange(-10, 11, 10.0),
    "azimuth": np.arange(100, 181, 10.0),
    "elevation": np.arange(-10, 11, 10.0),
}
NOISE = -125.0
ENDS = {"arrival": ("azimuth", "elevation"), "departure": ("departure_azimuth", "departure_elevation")}


@pytest.fixture(scope="module")
def bench(bench_maker):
    return bench_maker(describe(rx_antenna=HORN, tx_antenna=HORN))


@pytest.fixture(scope="module")
def scan(bench):
    """CIRs of paths (gain, delay, azimuth, elevation, and the two of departure), each link with phases of its own."""
    horn = Pattern.of(bench.sounder.rx_antenna)
    tx, rx = (np.stack(np.meshgrid(*list(AXES.values())[k : k + 2], indexing="ij"), -1) for k in (0, 2))
    shape = tuple(axis.size for axis in AXES.values())

    def make(paths, seed):
        rng = np.random.default_rng(seed)
        channel = np.zeros((*shape, bench.frequency.size), complex)
        for gain, delay, azimuth, elevation, *departure in paths:
            at_rx = horn.beam_gain(azimuth, elevation, rx[..., 0], rx[..., 1])
            at_tx = horn.beam_gain(*departure, tx[..., 0], tx[..., 1])
            amplitude = 10 ** ((gain + at_tx[:, :, None, None] + at_rx) / 20)
            turned = amplitude * np.exp(2j * np.pi * rng.random(shape))
            channel += turned[..., None] * np.exp(-2j * np.pi * bench.frequency * delay)
        cir = bench.cir(channel) + bench.noise(rng, np.prod(shape)).reshape(channel.shape) * 10 ** (NOISE / 20)
        delay = np.arange(channel.shape[-1]) / bench.sounder.waveform.sample_rate
        return xr.Dataset({"cir": ((*AXES, "delay"), cir.astype(np.complex64))}, AXES | {"delay": delay})

    return make


def random_paths(rng):
    """Paths within the half-power edges of both fans, apart in delay."""
    angles = rng.uniform([103, -10, -27, -10], [177, 10, 27, 10], (8, 4))
    delay = 100e-9 + 60e-9 * np.arange(8) + rng.uniform(0, 20e-9, 8)
    return np.column_stack([-90.0 - 2 * np.arange(8), delay, angles])


def columns(table, suffix=""):
    names = ["path_gain", "delay", *ENDS["arrival"], *ENDS["departure"]]
    return np.stack([table[f"{name}{suffix}"].values for name in names], axis=-1)


@pytest.mark.slow
def test_errors_at_both_ends_are_as_stated(bench, scan):
    """8 paths in each of 2 draws: the mean square of 96 figures is 1 within 4 of its standard deviations."""
    deviations = []
    for seed in range(2):
        paths = random_paths(np.random.default_rng(seed))
        table = extract_mpcs(scan(paths, seed), bench.filter_, bench.sounder).sortby("delay")
        assert table.sizes["mpc"] == len(paths)
        error = columns(table) - paths
        error[:, [2, 4]] = (error[:, [2, 4]] + 180) % 360 - 180
        deviations.append(error / columns(table, "_std"))
    deviations = np.array(deviations).reshape(-1, 6)
    assert np.mean(deviations**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / deviations.size))
    assert (np.mean(deviations**2, axis=0) < 1 + 4 * np.sqrt(2 / len(deviations))).all()


@pytest.mark.slow
def test_errors_are_the_bound(bench, scan):
    """One path: ``cov(arrival, departure, ln A)`` is the inverse of the information of all links together."""
    path = np.array([-90.0, 150e-9, 133.0, 3.0, -7.0, -4.0])
    cir = scan(path[None], 5)
    table = extract_mpcs(cir, bench.filter_, bench.sounder)
    ends = []
    for k, axes in ((2, ("azimuth", "elevation")), (4, ("tx_azimuth", "tx_elevation"))):
        beams = np.stack(np.meshgrid(*(AXES[axis] for axis in axes), indexing="ij"), -1).reshape(-1, 2)
        ends.append(slopes(path[k], path[k + 1], beams, Cuts.of(Pattern.of(bench.sounder.rx_antenna))))
    (g, *arrival), (h, *departure) = ends
    model = [np.outer(h, a) for a in arrival] + [np.outer(d, g) for d in departure] + [np.outer(h, g)]
    jacobian = 10 ** (path[0] / 20) * np.stack(model).reshape(5, -1)
    variance = bench.filter_.matched_filter.amplitude_variance * 10 ** (NOISE / 10) / 2
    bound = np.sqrt(np.diag(np.linalg.inv(jacobian @ jacobian.T / variance)))
    bound[-1] *= 20 / np.log(10)
    names = [*ENDS["arrival"], *ENDS["departure"], "path_gain"]
    stated = np.array([float(table[f"{name}_std"][0]) for name in names])
    # 9 of 27 and 9 of 21 beams enter the fit, and the noise floor is measured
    np.testing.assert_allclose(stated, bound, rtol=0.15)


@pytest.mark.slow
def test_departures_tell_paths_of_one_arrival_apart(bench, scan):
    """Two paths within a sample and from one direction, which left 15 degrees apart, in three draws of their phases.

    Fitted in turn their delays are off by some ten standard deviations.
    """
    paths = np.array([[-90.0, 150e-9, 140.0, 0.0, -7.0, 0.0], [-92.0, 150.6e-9, 140.0, 0.0, 8.0, 3.0]])
    for seed in range(3):
        table = extract_mpcs(scan(paths, seed), bench.filter_, bench.sounder)
        assert table.sizes["mpc"] == 2
        departure = (table["departure_azimuth"].values + 180) % 360 - 180
        order = np.argsort(departure)
        np.testing.assert_allclose(departure[order], paths[:, 4], atol=1.0)
        error = table["delay"].values[order] - paths[:, 1]
        assert (np.abs(error) < 4 * table["delay_std"].values[order]).all()


@pytest.mark.slow
def test_one_beam_is_the_scan_of_today(bench):
    """With one beam of the transmit antenna the table is that without its axes, to the last bit."""
    cir = bench.scan([(-90.0, 150e-9, 140.0, 0.0), (-95.0, 300e-9, 40.0, 5.0)], noise=NOISE)
    expanded = cir.expand_dims(tx_azimuth=[0.0], tx_elevation=[0.0])
    plain, same = (extract_mpcs(one, bench.filter_, bench.sounder) for one in (cir, expanded))
    xr.testing.assert_identical(plain, same)
