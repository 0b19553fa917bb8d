"""What nothing tells from a path: closed forms, and errors that are as large as stated where paths are dense."""

import numpy as np
import pytest

from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import columns as component
from sounder.mpc.extract import extract
from sounder.mpc.uncertainty import beams_seeing, scatter, unresolved

HORN = 24.5


@pytest.fixture(scope="module")
def looks(bench):
    return np.asarray(bench.sounder.scan.azimuth, float), np.asarray(bench.sounder.scan.elevation, float)


def rows(*paths):
    """Rows of the paths found: delay [sample], azimuth, elevation [degree], amplitude."""
    found = np.zeros((len(paths), component.COLUMNS))
    columns = [component.DELAY, component.AZIMUTH, component.ELEVATION, component.AMPLITUDE]
    found[:, columns] = paths
    return found


def test_beams_are_those_around_the_path_and_of_those_the_recorded(bench, looks):
    noise = np.ones(108)
    noise[4 * 3 + 1] = np.nan  # the beam at 40 degrees, level
    _, beam, weight = beams_seeing(rows((100.0, 41.0, 1.0, 1.0)), noise, looks, Pattern.of(bench.sounder.rx_antenna))
    assert set(beam[0, :2]) <= {3 * 4, 3 * 4 + 2, 3 * 5 + 1}
    assert weight.sum() == pytest.approx(1.0)
    assert weight[beam == 4 * 3 + 1].sum() == 0.0


def test_noise_scatters_by_one(bench, looks):
    """Where no delay was fitted to it, noise shows ``1 / (1 - sum w^2 / 2)``: the fit takes a part that it did not."""
    rng = np.random.default_rng(1)
    left = bench.noise(rng, 108).astype(np.complex64) * 3.0
    found = rows(*((rng.uniform(0, 1022), rng.uniform(0, 360), rng.uniform(-8, 8), 1.0) for _ in range(400)))
    noise = np.full(108, 9.0)
    seen = beams_seeing(found, noise, looks, Pattern.of(bench.sounder.rx_antenna))
    expected = 1 / (1 - (seen.weight**2).sum(axis=1) / 2)
    # each has some three beams' complex normal numbers: the mean of 400 is good to 0.6 / 20
    assert np.mean(scatter(found, left, noise, seen, bench.filter_) / expected) == pytest.approx(1.0, abs=0.09)


def test_density_is_interpolated_in_decibels_and_one_sided_is_none(bench, looks):
    pattern, noise = Pattern.of(bench.sounder.rx_antenna), np.ones(108)

    def density(*paths, left=None):
        found = rows((300.0, 40.0, 0.0, 1.0), *paths)
        return unresolved(found, left, noise, beams_seeing(found, noise, looks, pattern), bench.filter_)

    # of a neighbour 4 samples aside the 5 samples from 2 to 6 hold the main lobe: at -2, -1, 0, 1 and 2 from its peak
    lobe = np.mean(np.abs(bench.filter_.pulse[[-2, -1, 0, 1, 2]]) ** 2)
    straight = beams_seeing(rows((0, 40.0, 0.0, 1.0)), noise, looks, pattern)
    power = np.sum(straight.weight * straight.power[0, straight.beam])
    before, after = (296.0, 40.0, 0.0, 0.1), (304.0, 40.0, 0.0, 0.01)
    assert density(before, after)[0] == pytest.approx(0.1 * 0.01 * lobe * power, rel=1e-3)
    assert density(before)[0] == density(after)[0] == density()[0] == 0.0
    behind = (304.0, 220.0, 0.0, 0.01)  # only the floor of the pattern sees it, 40 dB down
    assert density(before, behind)[0] == pytest.approx(1e-2 * density(before, after)[0], rel=0.1)
    # what is left beside a path counts only over the noise
    left = np.zeros((108, 1022), np.complex64)
    left[:, [296, 304]] = np.sqrt(5 * 1.5)
    assert density(left=left)[0] == 0.0
    left *= np.sqrt(2)
    assert density(left=left)[0] == pytest.approx(3.0 - 1.0, rel=1e-6)


def test_errors_among_scattered_rays_are_as_stated(bench):
    """Rays 25 dB under a path, one in 0.6 ns: they move its delay by many times what the noise does."""
    rng = np.random.default_rng(4)
    error, stated = [], []
    for seed in range(20):
        path = -100.0, rng.uniform(100e-9, 700e-9), rng.uniform(0, 360), rng.uniform(-5, 5)
        late = rng.uniform(-8e-9, 8e-9, 25)
        rays = [(-125.0, path[1] + t, path[2] + rng.normal(0, 4), path[3] + rng.normal(0, 2)) for t in late]
        cir = bench.scan([path, *rays], noise=-100.0 + HORN - 50.0, seed=seed)
        table = extract(cir, bench.filter_, bench.sounder)
        best = table.isel(mpc=np.argmin(np.abs(table["delay"].values - path[1])))
        error.append(float(best["delay"]) - path[1])
        stated.append(float(best["delay_std"]))
    alone = 1.3e-12  # of one path at 50 dB
    assert np.sqrt(np.mean(np.square(error))) > 5 * alone
    # the RMS of 20 normal numbers is good to 16 %, that of errors of a few rays each to half
    assert 0.4 < np.sqrt(np.mean(np.square(np.array(error) / stated))) < 1.5
