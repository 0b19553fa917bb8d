"""Paths that are not resolved: closed forms, and errors that are as large as stated where paths are dense."""

from dataclasses import replace

import numpy as np
import pytest

from sounder.kernels.extraction.records import PATH
from sounder.mpc.extract import extract_mpcs
from sounder.mpc.scan import Scan
from sounder.mpc.uncertainty import beam_power, best_beams, scatter, unresolved_power

HORN = 24.5


@pytest.fixture(scope="module")
def scan(bench):
    """Beams with noise of power 1."""
    empty = bench.dataset(np.zeros((36, 3, 1022), np.complex64))
    return replace(Scan.of(empty, bench.filter_, bench.sounder), noise=np.ones(108))


def records(*paths):
    """Paths found: delay [sample], azimuth, elevation [degree], amplitude."""
    found = np.zeros(len(paths), PATH)
    for record, path in zip(found, paths, strict=True):
        record["delay"], record["azimuth"], record["elevation"], record["amplitude"] = path
    return found


def test_beams_are_those_around_the_path_and_of_those_the_recorded(scan):
    noise = np.ones(108)
    noise[4 * 3 + 1] = np.nan  # the beam at 40 degrees, level
    beam, weight = best_beams(beam_power(records((100.0, 41.0, 1.0, 1.0)), replace(scan, noise=noise)))
    assert set(beam[0, :2]) <= {3 * 4, 3 * 4 + 2, 3 * 5 + 1}
    assert weight.sum() == pytest.approx(1.0)
    assert weight[beam == 4 * 3 + 1].sum() == 0.0


def test_noise_scatters_by_one(bench, scan):
    """Where no delay was fitted to it, noise shows ``1 / (1 - sum w^2 / 2)``: the fit takes a part that it did not."""
    rng = np.random.default_rng(1)
    residual = bench.noise(rng, 108).astype(np.complex64) * 3.0
    found = records(*((rng.uniform(0, 1022), rng.uniform(0, 360), rng.uniform(-8, 8), 1.0) for _ in range(400)))
    power = beam_power(found, scan)
    _, weight = best_beams(power)
    expected = 1 / (1 - (weight**2).sum(axis=1) / 2)
    # each has some three beams' complex normal numbers: the mean of 400 is good to 0.6 / 20
    scattered = scatter(found, power, residual, replace(scan, noise=np.full(108, 9.0)))
    assert np.mean(scattered / expected) == pytest.approx(1.0, abs=0.09)


def test_density_is_interpolated_in_decibels_and_one_sided_is_none(bench, scan):
    def density(*paths, residual=None):
        found = records((300.0, 40.0, 0.0, 1.0), *paths)
        return unresolved_power(found, beam_power(found, scan), residual, scan)

    # of a neighbour 4 samples aside the 5 samples from 2 to 6 hold the main lobe: at -2, -1, 0, 1 and 2 from its peak
    lobe = np.mean(np.abs(bench.filter_.pulse[[-2, -1, 0, 1, 2]]) ** 2)
    straight = beam_power(records((0, 40.0, 0.0, 1.0)), scan)
    beam, weight = best_beams(straight)
    power = np.sum(weight * straight[0, beam])
    before, after = (296.0, 40.0, 0.0, 0.1), (304.0, 40.0, 0.0, 0.01)
    assert density(before, after)[0] == pytest.approx(0.1 * 0.01 * lobe * power, rel=1e-3)
    assert density(before)[0] == density(after)[0] == density()[0] == 0.0
    behind = (304.0, 220.0, 0.0, 0.01)  # only the floor of the pattern sees it, 40 dB down
    assert density(before, behind)[0] == pytest.approx(1e-2 * density(before, after)[0], rel=0.1)
    # residuals beside a path count only over the noise
    residual = np.zeros((108, 1022), np.complex64)
    residual[:, [296, 304]] = np.sqrt(5 * 1.5)
    assert density(residual=residual)[0] == 0.0
    residual *= np.sqrt(2)
    assert density(residual=residual)[0] == pytest.approx(3.0 - 1.0, rel=1e-6)


def test_what_follows_all_paths_alike_is_their_tail_and_fills_half_of_the_pulse(scan):
    found = records(*((delay, 40.0, 0.0, 1.0) for delay in (100.0, 300.0, 500.0, 700.0)))
    residual = np.zeros((108, 1022), np.complex64)
    for delay in (104, 304, 504):
        residual[:, delay] = np.sqrt(5 * 3.0)  # a mean of 3 over the 5 samples from 2 to 6, of which 1 is noise
    power = beam_power(found, scan)
    assert unresolved_power(found, power, residual, scan) == pytest.approx([1.0, 1.0, 1.0, 0.0], rel=1e-6)
    residual[:, [304, 504]] = 0.0  # one of four has a neighbour: no tail
    assert np.all(unresolved_power(found, power, residual, scan) == 0.0)


@pytest.mark.slow
def test_azimuths_of_paths_with_tails_are_as_stated(bench):
    """Rays 10 to 25 dB under each of three paths, after it and never before."""
    rng = np.random.default_rng(5)
    deviation = []
    for seed in range(12):
        paths = [(-100.0, 1e-9 * t, rng.uniform(0, 360), rng.uniform(-5, 5)) for t in (150, 350, 550)]
        rays = [
            (gain - rng.uniform(10, 25), t + rng.exponential(3e-9), a + rng.normal(0, 6), e + rng.normal(0, 3))
            for gain, t, a, e in paths
            for _ in range(8)
        ]
        cir = bench.scan([*paths, *rays], noise=-100.0 + HORN - 50.0, seed=seed)
        table = extract_mpcs(cir, bench.filter_, bench.sounder)
        for path in paths:
            best = table.isel(mpc=np.argmin(np.abs(table["delay"].values - path[1])))
            error = (float(best["azimuth"]) - path[2] + 180) % 360 - 180
            deviation.append(error / float(best["azimuth_std"]))
    # without the tails one of four is beyond 3.7
    assert np.mean(np.abs(deviation) > 3.7) < 0.06
    assert np.mean(np.abs(deviation) < 2) > 0.8


@pytest.mark.slow
def test_errors_among_scattered_rays_are_as_stated(bench):
    """Rays 25 dB under a path, one in 0.6 ns: they move its delay by many times what the noise does."""
    rng = np.random.default_rng(4)
    error, stated = [], []
    for seed in range(20):
        path = -100.0, rng.uniform(100e-9, 700e-9), rng.uniform(0, 360), rng.uniform(-5, 5)
        late = rng.uniform(-8e-9, 8e-9, 25)
        rays = [(-125.0, path[1] + t, path[2] + rng.normal(0, 4), path[3] + rng.normal(0, 2)) for t in late]
        cir = bench.scan([path, *rays], noise=-100.0 + HORN - 50.0, seed=seed)
        table = extract_mpcs(cir, bench.filter_, bench.sounder)
        best = table.isel(mpc=np.argmin(np.abs(table["delay"].values - path[1])))
        error.append(float(best["delay"]) - path[1])
        stated.append(float(best["delay_std"]))
    alone = 1.3e-12  # of one path at 50 dB
    assert np.sqrt(np.mean(np.square(error))) > 5 * alone
    # the RMS of 20 normal numbers is good to 16 %, that of errors of a few rays each to half
    assert 0.4 < np.sqrt(np.mean(np.square(np.array(error) / stated))) < 1.5
