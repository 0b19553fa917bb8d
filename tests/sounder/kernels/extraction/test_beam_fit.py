"""The angle of a path from its magnitudes in neighbouring beams."""

import numba
import numpy as np
import pytest

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import beam_fit, scan_view

PATTERN = Pattern.of(Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0, sidelobe_floor=-40.0))
LOOKS = np.array([[a, e] for a in (-10.0, 0.0, 10.0) for e in (-9.0, 0.0, 9.0)])


@numba.njit
def fit_angles(*arguments):
    return beam_fit.fit_angles(*arguments)


@numba.njit
def pattern_toward(seen_with, azimuth, elevation, beam, slopes):
    direction = np.empty(4)
    scan_view.aim(azimuth, elevation, direction)
    return scan_view.pattern(seen_with, direction, beam, slopes)


@pytest.fixture
def fit(make_view):
    def run(magnitude, *, looks=LOOKS, start=(0.0, 0.0), free=(1.0, 1.0), noise=0.0):
        result = np.zeros(beam_fit.RESULTS)
        result[:2] = start
        near = np.append(np.arange(len(looks)), -1)
        bounds = np.array([-20.0, 20.0, -20.0, 20.0])
        seen_with = make_view(PATTERN, looks, 1.0, (3, 3, 0))
        scratch = np.empty(4), np.empty(2), np.empty(beam_fit.SUMS)
        cost = fit_angles(seen_with, np.asarray(magnitude), near, noise, bounds, np.array(free), 20.0, *scratch, result)
        return cost, result

    return run


def seen(azimuth, elevation, looks=LOOKS):
    return 10 ** (PATTERN.beam_gain(azimuth, elevation, looks[:, 0], looks[:, 1]) / 20)


def test_compiled_pattern_is_the_numpy_one(make_view):
    rng = np.random.default_rng(1)
    looks = np.column_stack([rng.uniform(0, 360, 200), rng.uniform(-30, 30, 200)])
    seen_with = make_view(PATTERN, looks, 1.0, (200, 1, 0))
    for beam, azimuth, elevation in zip(
        range(200), rng.uniform(-360, 360, 200), rng.uniform(-89, 89, 200), strict=True
    ):
        got = pattern_toward(seen_with, azimuth, elevation, beam, np.empty(2))
        assert got == pytest.approx(10 ** (PATTERN.beam_gain(azimuth, elevation, *looks[beam]) / 20), rel=1e-9)


def test_slopes_are_derivatives(make_view):
    rng = np.random.default_rng(2)
    looks = np.column_stack([rng.uniform(0, 360, 50), rng.uniform(-30, 30, 50)])
    seen_with = make_view(PATTERN, looks, 1.0, (50, 1, 0))
    for beam in range(50):
        azimuth, elevation = looks[beam] + rng.uniform(-8, 8, 2)
        slopes = np.empty(2)
        g = pattern_toward(seen_with, azimuth, elevation, beam, slopes)
        if g <= 10 ** (PATTERN.floor / 20):
            assert not slopes.any()
            continue
        step = 0.5  # two points of the cuts, whose slopes are central differences
        for i, (da, de) in enumerate([(step, 0), (0, step)]):
            after = pattern_toward(seen_with, azimuth + da, elevation + de, beam, np.empty(2))
            before = pattern_toward(seen_with, azimuth - da, elevation - de, beam, np.empty(2))
            # the third derivative of a Gaussian of 10 degree is under 3 (1/3.6)^3, times step^2 / 6
            assert slopes[i] == pytest.approx((after - before) / (2 * step), abs=0.007)


def test_magnitudes_without_noise_give_the_direction(fit):
    rng = np.random.default_rng(2)
    for _ in range(30):
        azimuth, elevation, a = rng.uniform(-5, 5), rng.uniform(-4.5, 4.5), rng.uniform(0.1, 10)
        cost, result = fit(a * seen(azimuth, elevation))
        # it stops when a step would gain less than 1e-6 of the cost, and quadratic convergence is then far beyond
        np.testing.assert_allclose(result[:3], [azimuth, elevation, a], atol=1e-4 * max(a, 1))
        assert cost < 1e-8 * a**2


def test_fixed_angles_stay(fit):
    row = LOOKS[:, 1] == 0
    _, result = fit(seen(3.0, 0.0)[row], looks=LOOKS[row], free=(1.0, 0.0))
    np.testing.assert_allclose(result[:3], [3.0, 0.0, 1.0], atol=1e-4)
    assert np.isnan(result[4])
    assert np.isfinite(result[[3, 5]]).all()


def test_bounds_hold(fit):
    _, result = fit(seen(0.0, 60.0))
    assert (np.abs(result[:2]) <= 20.0).all()


def test_scatter_is_the_stated_covariance(fit):
    """Gaussian errors of the magnitudes spread the results as the normal equations say."""
    rng = np.random.default_rng(3)
    sigma = 0.01
    results = np.array([fit(seen(2.0, -3.0) + sigma * rng.standard_normal(9), noise=sigma**2)[1] for _ in range(120)])
    spread = results[:, :3].std(axis=0)
    # 120 draws give a deviation to 6.5 %, four of which are 26 %
    np.testing.assert_allclose(spread / np.median(np.sqrt(results[:, 3:6]), axis=0), 1.0, atol=0.3)
    correlation = np.corrcoef(results[:, :3].T)[[0, 0, 1], [1, 2, 2]]
    stated = results[:, 6:9] / np.sqrt(results[:, [3, 3, 4]] * results[:, [4, 5, 5]])
    # and a correlation to (1 - r^2) / sqrt(120) = 0.09
    np.testing.assert_allclose(correlation, np.median(stated, axis=0), atol=0.28)
    # Residuals of 6 degrees of freedom exceed twice their deviation in 4.4 % of draws, by 1.45 of the variance on
    # average: 1.065, good to 0.03. The larger of noise and residual would be 1.2.
    assert np.mean(results[:, 3]) / np.median(results[:, 3]) < 1.065 + 2 * 0.03
    # residuals of 6 degrees of freedom in 120 draws: mean 1 to sqrt(2 / 720)
    assert results[:, beam_fit.MISFIT].mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / 720))
    np.testing.assert_allclose(results[:, :3].mean(axis=0), [2.0, -3.0, 1.0], atol=4 * spread.max() / np.sqrt(120))


def test_alike_in_all_beams_determines_no_angle(fit):
    """Where the model is at its floor in every beam no angle matters; its deviation says so."""
    _, result = fit(np.full(3, 0.01), looks=np.array([[170.0, 0.0], [180.0, 0.0], [190.0, 0.0]]))
    assert np.isinf(result[3])
    assert np.isinf(result[4])
