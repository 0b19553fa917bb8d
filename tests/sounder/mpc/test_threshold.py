"""The false-alarm rate of a campaign, whatever the instrument."""

import numpy as np
import pytest
import xarray as xr

from sounder.mpc.extract import extract_mpcs
from sounder.mpc.scan import Scan
from sounder.options import Threshold

POLYNOMIALS = {7: (7, 1, 0), 8: (8, 4, 3, 2, 0), 9: (9, 4, 0)}


def random_bench(bench_maker, description, rng):
    """Bench of a random description: order, rate, bandwidth, beamwidth, number of beams."""
    order, per_chip = int(rng.integers(7, 10)), int(rng.integers(1, 5))
    chip_rate, width = rng.uniform(0.1e9, 2e9), rng.uniform(8, 30)
    waveform = {"order": order, "polynomial": POLYNOMIALS[order], "samples_per_chip": per_chip}
    waveform |= {"chip_rate": chip_rate, "sample_rate": chip_rate * per_chip}
    antenna = {"pattern": "gaussian", "cut": None, "hpbw_azimuth": width, "hpbw_elevation": width}
    rows = np.arange(rng.integers(1, 4)) * width
    scan = {"azimuth": tuple(np.arange(0, 360 - width / 2, width)), "elevation": tuple(rows - rows.mean())}
    return bench_maker(
        description(waveform=waveform, rx_antenna=antenna, scan=scan, processing={"bandwidth": None}),
        seed=int(rng.integers(100)),
    )


@pytest.mark.slow
def test_noise_exceeds_the_threshold_at_the_stated_rate_for_any_instrument(bench_maker, description):
    """Ten samples of a scan. Neighbours exceed it together, at most four of them, so that the variance is four-fold."""
    rng = np.random.default_rng(20)
    exceeded = mpcs = 0
    for seed in range(15):
        bench = random_bench(bench_maker, description, rng)
        cir = bench.scan([], noise=-150.0, seed=seed)
        scan = Scan.of(cir, bench.filter_, bench.sounder, Threshold(false_alarms=10.0))
        exceeded += int(np.sum(np.abs(scan.cir) ** 2 > scan.threshold[:, None]))
        if seed < 5:
            mpcs += extract_mpcs(cir, bench.filter_, bench.sounder, threshold="cfar:1").sizes["mpc"]
    assert abs(exceeded - 150) < 3 * np.sqrt(4 * 150)
    assert mpcs <= 5 + 3 * np.sqrt(5)


def test_powers_that_were_averaged_need_a_lower_level(bench):
    cir = bench.scan([], noise=-150.0)
    single = Scan.of(cir, bench.filter_, bench.sounder, "cfar")
    rng = np.random.default_rng(0)
    power = rng.gamma(8, 1e-15 / 8, cir["cir"].shape)
    averaged = xr.Dataset({"cir": (cir["cir"].dims, np.sqrt(power).astype(np.complex64))}, cir.coords)
    scan = Scan.of(averaged.assign_attrs(averaging="power", snapshots=8), bench.filter_, bench.sounder, "cfar")
    assert np.mean(scan.noise) / 1e-15 == np.clip(np.mean(scan.noise) / 1e-15, 0.98, 1.02)
    ratio = np.mean(scan.threshold / scan.noise) / np.mean(single.threshold / single.noise)
    assert 10 * np.log10(ratio) == np.clip(10 * np.log10(ratio), -6.5, -5.5)  # 5.8 dB instead of 11.9 dB
