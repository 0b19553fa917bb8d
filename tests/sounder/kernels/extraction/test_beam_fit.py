"""The angle of a path from its magnitudes in neighbouring beams."""

import numba
import numpy as np
import pytest

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import beam_fit, scan_view
from sounder.kernels.extraction.records import PATH

PATTERN = Pattern.of(Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0, sidelobe_floor=-40.0))
LOOKS = np.array([[a, e] for a in (-10.0, 0.0, 10.0) for e in (-9.0, 0.0, 9.0)])


pytestmark = pytest.mark.slow  # a function is compiled anew


@numba.njit
def fit_angles(*arguments):
    return beam_fit.fit_angles(*arguments)


@numba.njit
def pattern_toward(view, azimuth, elevation, beam):
    return scan_view.pattern(view, beam, scan_view.toward(azimuth, elevation))


@pytest.fixture
def fit(make_view):
    def run(magnitude, *, looks=LOOKS, start=(0.0, 0.0), free=(1.0, 1.0), noise=0.0):
        path = np.zeros(1, PATH)[0]
        path["azimuth"], path["elevation"] = start
        near = np.append(np.arange(len(looks)), -1)
        bounds = -20.0, 20.0, -20.0, 20.0
        view = make_view(PATTERN, looks, 1.0, 3, 3, False).arrival
        cost = fit_angles(view, np.asarray(magnitude), near, noise, bounds, free, 20.0, path)
        return cost, path

    return run


PARAMETERS = ["azimuth", "elevation", "amplitude"]
VARIANCES = [f"{name}_variance" for name in PARAMETERS]
COVARIANCES = ["azimuth_elevation", "azimuth_amplitude", "elevation_amplitude"]


def values(paths, names):
    """Fields of paths as columns."""
    return np.stack([paths[name] for name in names], axis=-1)


def seen(azimuth, elevation, looks=LOOKS):
    return 10 ** (PATTERN.beam_gain(azimuth, elevation, looks[:, 0], looks[:, 1]) / 20)


def test_compiled_pattern_is_the_numpy_one(make_view):
    rng = np.random.default_rng(1)
    looks = np.column_stack([rng.uniform(0, 360, 200), rng.uniform(-30, 30, 200)])
    view = make_view(PATTERN, looks, 1.0, 200, 1, False).arrival
    for beam, azimuth, elevation in zip(
        range(200), rng.uniform(-360, 360, 200), rng.uniform(-89, 89, 200), strict=True
    ):
        got, _, _ = pattern_toward(view, azimuth, elevation, beam)
        assert got == pytest.approx(10 ** (PATTERN.beam_gain(azimuth, elevation, *looks[beam]) / 20), rel=1e-9)


def test_slopes_are_derivatives(make_view):
    rng = np.random.default_rng(2)
    looks = np.column_stack([rng.uniform(0, 360, 50), rng.uniform(-30, 30, 50)])
    view = make_view(PATTERN, looks, 1.0, 50, 1, False).arrival
    for beam in range(50):
        azimuth, elevation = looks[beam] + rng.uniform(-8, 8, 2)
        g, *slopes = pattern_toward(view, azimuth, elevation, beam)
        if g <= 10 ** (PATTERN.floor / 20):
            assert slopes == [0.0, 0.0]
            continue
        step = 0.5  # two points of the cuts, whose slopes are central differences
        for i, (da, de) in enumerate([(step, 0), (0, step)]):
            after, _, _ = pattern_toward(view, azimuth + da, elevation + de, beam)
            before, _, _ = pattern_toward(view, azimuth - da, elevation - de, beam)
            # the third derivative of a Gaussian of 10 degree is under 3 (1/3.6)^3, times step^2 / 6
            assert slopes[i] == pytest.approx((after - before) / (2 * step), abs=0.007)


def test_magnitudes_without_noise_give_the_direction(fit):
    rng = np.random.default_rng(2)
    for _ in range(30):
        azimuth, elevation, a = rng.uniform(-5, 5), rng.uniform(-4.5, 4.5), rng.uniform(0.1, 10)
        cost, path = fit(a * seen(azimuth, elevation))
        # it stops when a step would gain less than 1e-6 of the cost, and quadratic convergence is then far beyond
        np.testing.assert_allclose(values(path, PARAMETERS), [azimuth, elevation, a], atol=1e-4 * max(a, 1))
        assert cost < 1e-8 * a**2


def test_fixed_angles_stay(fit):
    row = LOOKS[:, 1] == 0
    _, path = fit(seen(3.0, 0.0)[row], looks=LOOKS[row], free=(1.0, 0.0))
    np.testing.assert_allclose(values(path, PARAMETERS), [3.0, 0.0, 1.0], atol=1e-4)
    assert np.isnan(path["elevation_variance"])
    assert np.isfinite(path["azimuth_variance"])
    assert np.isfinite(path["amplitude_variance"])


def test_bounds_hold(fit):
    _, path = fit(seen(0.0, 60.0))
    assert (np.abs(values(path, PARAMETERS[:2])) <= 20.0).all()


def test_scatter_is_the_stated_covariance(fit):
    """Gaussian errors of the magnitudes spread the results as the normal equations say."""
    rng = np.random.default_rng(3)
    sigma = 0.01
    results = np.array([fit(seen(2.0, -3.0) + sigma * rng.standard_normal(9), noise=sigma**2)[1] for _ in range(120)])
    got, variance = values(results, PARAMETERS), values(results, VARIANCES)
    spread = got.std(axis=0)
    # 120 draws give a deviation to 6.5 %, four of which are 26 %
    np.testing.assert_allclose(spread / np.median(np.sqrt(variance), axis=0), 1.0, atol=0.3)
    correlation = np.corrcoef(got.T)[[0, 0, 1], [1, 2, 2]]
    stated = values(results, COVARIANCES) / np.sqrt(variance[:, [0, 0, 1]] * variance[:, [1, 2, 2]])
    # and a correlation to (1 - r^2) / sqrt(120) = 0.09
    np.testing.assert_allclose(correlation, np.median(stated, axis=0), atol=0.28)
    # Residuals of 6 degrees of freedom exceed twice their deviation in 4.4 % of draws, by 1.45 of the variance on
    # average: 1.065, good to 0.03. The larger of noise and residual would be 1.2.
    assert np.mean(variance[:, 0]) / np.median(variance[:, 0]) < 1.065 + 2 * 0.03
    # residuals of 6 degrees of freedom in 120 draws: mean 1 to sqrt(2 / 720)
    assert results["misfit"].mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / 720))
    np.testing.assert_allclose(got.mean(axis=0), [2.0, -3.0, 1.0], atol=4 * spread.max() / np.sqrt(120))


def test_alike_in_all_beams_determines_no_angle(fit):
    """Where the model is at its floor in every beam no angle matters; its deviation says so."""
    _, path = fit(np.full(3, 0.01), looks=np.array([[170.0, 0.0], [180.0, 0.0], [190.0, 0.0]]))
    assert np.isinf(path["azimuth_variance"])
    assert np.isinf(path["elevation_variance"])
