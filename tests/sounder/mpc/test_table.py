"""What the table says of an MPC beside where it is: covariance, SNR, misfit, wrapping; and how it was looked for."""

import numpy as np
import pytest
from scipy.constants import c

from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Artefact, Processing
from sounder.mpc.extract import extract_mpcs

HORN = 24.5
STDS = ("delay_std", "azimuth_std", "elevation_std", "path_gain_std")


def mpcs(bench, paths, *, noise=-130.0, seed=0, **options):
    return extract_mpcs(bench.scan(paths, noise=noise, seed=seed), bench.filter_, bench.sounder, **options)


def test_covariance_is_one(bench):
    rng = np.random.default_rng(1)
    inside = [(-100.0, 100e-9 * i, rng.uniform(0, 360), rng.uniform(-8, 8)) for i in range(1, 8)]
    beyond = [(-100.0, 50e-9, 44.0, 14.0), (-100.0, 450e-9, 200.0, -15.0)]
    table = mpcs(bench, inside + beyond)
    assert table.sizes["mpc"] == 9
    covariance = table["covariance"].values
    np.testing.assert_allclose(covariance, covariance.swapaxes(1, 2))
    np.testing.assert_allclose(
        np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), np.stack([table[name] for name in STDS], axis=-1)
    )
    scale = np.stack([table[name] for name in STDS], axis=-1)
    assert (np.linalg.eigvalsh(covariance / scale[:, :, None] / scale[:, None, :]) > -1e-9).all()
    # beyond the fan a path is the weaker the nearer to it, so its errors of elevation and gain go together
    out = np.flatnonzero(table["elevation_std"] > 1)
    assert out.size > 0
    together = covariance[out, 2, 3] / (scale[out, 2] * scale[out, 3])
    np.testing.assert_allclose(together * np.sign(table["elevation"].values[out]), 1.0, atol=0.1)


def test_snr_is_that_of_the_best_beam(bench):
    horn = Pattern.of(bench.sounder.rx_antenna)
    for azimuth, elevation in ((40.0, 0.0), (44.0, 3.0)):
        (row,) = mpcs(bench, [(-100.0, 200e-9, azimuth, elevation)], noise=-105.0)["snr"].values
        expected = -100.0 + HORN + float(horn.beam_gain(azimuth, elevation, 40.0, 0.0)) + 105.0
        # the noise power is known to 1 / sqrt(1022), the amplitude to 1 / sqrt(2 SNR) = 0.03
        assert row == pytest.approx(expected, abs=0.8)


@pytest.mark.slow
def test_misfit_tells_two_paths_in_one_from_one(bench):
    """Of one path in noise it is 1 by definition; two that the pulse cannot separate leave far more than noise."""
    rng = np.random.default_rng(2)
    one, two, split = [], [], []
    for seed in range(30):
        first = -100.0, rng.uniform(30e-9, 800e-9), rng.uniform(0, 360), rng.uniform(-8, 8)
        second = -104.0, first[1] + 0.5e-9, first[2] + 6.0, first[3]
        noise = -100.0 + HORN - 35.0
        one += mpcs(bench, [first], noise=noise, seed=seed)["misfit"].values[:1].tolist()
        found = mpcs(bench, [first, second], noise=noise, seed=seed)["misfit"].values
        two += found[:1].tolist()
        split += [found.size > 1] * bool(found.size)
    assert len(one) == 30
    assert len(two) >= 27  # some such pairs look as if only sidelobes saw them, and are left out
    # 9 magnitudes less 3 unknowns, and 5 samples less what is fitted to them: the mean of 30 is good to some 15 %
    assert 0.5 < np.mean(one) < 1.3
    assert np.median(np.array(two)[~np.array(split)]) > 5  # of those that are not split: the others fit
    assert np.mean((np.array(two) > max(one)) | split) > 0.7


def test_only_what_free_space_allows_later_may_be_wrapped(bench):
    """A direct path of 30 m is 20 dB stronger than anything can be after 285 m; one 25 dB weaker may be that."""
    delay, period = 30 / c, 1022 / 1.2e9
    free = 20 * np.log10(c / (4 * np.pi * 132e9 * 30))
    later = 20 * np.log10(30 / (30 + c * period))
    table = mpcs(bench, [(free, delay, 40.0, 0.0), (free + later - 5, delay + 50e-9, 140.0, 0.0)], noise=-150.0)
    assert list(table["may_be_wrapped"].values) == [0, 1]


@pytest.mark.slow
def test_methods_differ_where_paths_overlap(bench):
    """Alone a path is the same by any; beside another, nearly a pulse away, each step of effort takes off error."""
    alone = [(-100.0, 200e-9, 40.0, 2.0), (-110.0, 300e-9, 200.0, -5.0)]
    tables = {method: mpcs(bench, alone, method=method) for method in ("sage", "clean", "peaks")}
    for table in tables.values():
        assert table.sizes["mpc"] == 2
        np.testing.assert_allclose(table["delay"], [200e-9, 300e-9], atol=0.02e-9)
        np.testing.assert_allclose(table["azimuth"], [40.0, 200.0], atol=0.2)
    assert [tables[m].attrs["method"] for m in tables] == list(tables)

    errors = {method: [] for method in tables}
    rng = np.random.default_rng(3)
    for seed in range(15):
        first = -100.0, rng.uniform(30e-9, 800e-9), rng.uniform(0, 360), rng.uniform(-8, 8)
        second = -103.0, first[1] + 1.7e-9, first[2] + 4.0, first[3]
        for method, error in errors.items():
            table = mpcs(bench, [first, second], noise=-120.0, seed=seed, method=method)
            late = np.abs(table["delay"].values[:, None] - [first[1], second[1]])
            error.append(late.min(axis=0).max())
    rmse = {method: np.sqrt(np.mean(np.square(error))) for method, error in errors.items()}
    # the noise, 45 dB down, makes some 4 ps; what one pulse does to the maximum of another 10 times that and more
    assert rmse["sage"] < 0.2 * rmse["clean"]
    assert rmse["clean"] < 0.9 * rmse["peaks"]


@pytest.mark.slow
def test_copies_that_the_instrument_makes_are_no_paths(bench):
    """A path 40 ns later and 20 dB weaker is taken for a path, unless the description says the instrument makes it."""
    paths = [(-100.0, 200e-9, 40.0, 2.0), (-120.5, 240e-9, 40.0, 2.0), (-112.0, 300e-9, 140.0, 2.0)]
    told = bench.sounder.model_copy(update={"processing": Processing(artefact=(Artefact(delay=40e-9, level=-20.0),))})
    cir = bench.scan(paths, noise=-130.0)
    assert extract_mpcs(cir, bench.filter_, bench.sounder).sizes["mpc"] == 3
    found = extract_mpcs(cir, bench.filter_, told)
    np.testing.assert_allclose(found["delay"], [200e-9, 300e-9], atol=0.1e-9)
    # a path that is stronger than any copy is one
    stronger = [paths[0], (-117.0, *paths[1][1:])]
    cir = bench.scan(stronger, noise=-130.0)
    assert extract_mpcs(cir, bench.filter_, told).sizes["mpc"] == 2
