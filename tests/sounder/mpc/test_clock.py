"""A clock that wanders from direction to direction, in the errors of the delays."""

import numpy as np
import pytest
import xarray as xr

from sounder.instrument.description import Clock
from sounder.mpc.clock import clock_variance, scan_order
from sounder.mpc.extract import extract_mpcs
from sounder.twin.faults import DelayDrift, Faults
from sounder.twin.receiver import record


def test_variance_is_that_of_the_walk():
    """Means of the walk that the twin draws, over the beams of a path that straddles two elevations."""
    order = scan_order(None, 36, 3)
    beam = np.array([[12, 13, 15], [0, 1, 2], [107, 107, 107]])
    weight = np.array([[0.5, 0.3, 0.2], [0.1, 0.1, 0.8], [1.0, 0.0, 0.0]])
    rng = np.random.default_rng(2)
    walks = np.array([DelayDrift(step=3e-12).delay(rng, 108) for _ in range(4000)])
    means = np.einsum("wpb,pb->wp", walks[:, order[beam]], weight)
    # the variance of 4000 normal numbers is good to sqrt(2 / 4000) = 2.2 %
    np.testing.assert_allclose(clock_variance(beam, weight, order, 3e-12), means.var(axis=0), rtol=0.08)
    assert clock_variance(beam, weight, order, 3e-12)[2] == pytest.approx(107 * 9e-24)


def test_order_is_that_of_the_times():
    time = np.array([[5.0, 1.0], [2.0, np.nan]])
    np.testing.assert_array_equal(scan_order(time, 2, 2), [2, 0, 1, 3])
    np.testing.assert_array_equal(scan_order(None, 3, 2), [0, 3, 1, 4, 2, 5])  # all azimuths at each elevation


def test_delays_know_the_clock_and_nothing_else_does(bench):
    cir = bench.scan([(-100.0, 200e-9, 40.0, 0.0), (-100.0, 300e-9, 140.0, 9.0)], noise=-130.0)
    told = bench.sounder.model_copy(update={"clock": Clock(step=5e-12)})
    plain, table = (extract_mpcs(cir, bench.filter_, sounder) for sounder in (bench.sounder, told))
    assert (plain["clock_std"] == 0).all()
    both = np.sqrt(plain["delay_std"] ** 2 + table["clock_std"] ** 2)
    np.testing.assert_allclose(table["delay_std"], both)
    # straight at the beams 36 + 4 and 72 + 14 of the scan; the beams around them are at most 37 steps away
    np.testing.assert_allclose(np.sort(table["clock_std"]) / 5e-12, np.sqrt([40.0, 86.0]), rtol=0.1)
    for name in ("delay", "azimuth_std", "elevation_std", "path_gain_std"):
        np.testing.assert_array_equal(plain[name], table[name])
    last_first = np.arange(108.0)[::-1].reshape(3, 36).T
    turned = extract_mpcs(cir, bench.filter_, told, time=last_first)
    np.testing.assert_allclose(np.sort(turned["clock_std"]) / 5e-12, np.sqrt([107 - 86.0, 107 - 40.0]), rtol=0.2)


@pytest.mark.parametrize(("drift", "step"), [(DelayDrift(step=4e-12), 4e-12), (False, 0.0)])
def test_the_twin_describes_its_own_clock(bench, drift, step):
    paths = xr.Dataset(
        {"delay": ("path", [50e-9]), "azimuth": ("path", [40.0]), "elevation": ("path", [0.0])}
        | {"coefficient": ("path", [1e-5 + 0j])}
    )
    recording = record(
        paths,
        bench.sounder,
        name="A",
        tx_position=[0, 0, 0],
        rx_position=[15, 0, 0],
        snapshots=1,
        faults=Faults.absent(delay_drift=drift),
    )
    assert recording.sounder.clock.step == step
