"""Fits of path loss return what the losses were made of, and their intervals hold it as often as they say."""

import numpy as np
import pytest
from scipy import stats

from sounder.parameters.path_loss import close_in, floating_intercept, free_space_path_loss

FREQUENCY = 132e9
DISTANCE = np.array([12.0, 20.0, 35.0, 50.0, 80.0, 130.0])


def test_free_space_at_a_metre():
    assert float(free_space_path_loss(1.0, 299792458 / (4 * np.pi))) == pytest.approx(0, abs=1e-9)
    assert float(free_space_path_loss(1.0, FREQUENCY)) == pytest.approx(74.8593, abs=1e-3)


def test_fits_without_shadowing_are_exact():
    loss = free_space_path_loss(1.0, FREQUENCY) + 10 * 2.73 * np.log10(DISTANCE)
    fit = close_in(DISTANCE, loss, FREQUENCY)
    assert (fit.exponent, fit.shadowing) == pytest.approx((2.73, 0), abs=1e-6)
    line = floating_intercept(DISTANCE, 50 + 10 * 3.1 * np.log10(DISTANCE))
    assert (line.intercept, line.exponent, line.shadowing) == pytest.approx((50, 3.1, 0), abs=1e-6)


def test_the_shadowing_of_a_constructed_residual():
    """Residuals orthogonal to the fitted columns leave them, and are the shadowing."""
    decades = 10 * np.log10(DISTANCE)
    columns = np.column_stack([np.ones(6), decades])
    residual = np.linalg.qr(np.column_stack([columns, [1.0, -2, 3, -1, 2, 5]]))[0][:, 2] * 4.0
    fit = floating_intercept(DISTANCE, 60 + 2.2 * decades + residual)
    assert (fit.intercept, fit.exponent, fit.shadowing) == pytest.approx((60, 2.2, 4 / np.sqrt(6)), rel=1e-6)
    near = close_in(DISTANCE, free_space_path_loss(1.0, FREQUENCY) + 2.2 * decades + residual, FREQUENCY)
    assert (near.exponent, near.shadowing) == pytest.approx((2.2, 4 / np.sqrt(6)), rel=1e-6)


def test_frequencies_may_differ():
    frequency = np.array([28e9, 132e9] * 3)
    loss = free_space_path_loss(1.0, frequency) + 20 * np.log10(DISTANCE)
    assert close_in(DISTANCE, loss, frequency).exponent == pytest.approx(2.0, abs=1e-9)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(3)
    held = np.zeros(4)
    for _ in range(400):
        shadow = 5 * rng.normal(size=6)
        fit = close_in(DISTANCE, free_space_path_loss(1.0, FREQUENCY) + 25 * np.log10(DISTANCE) + shadow, FREQUENCY)
        line = floating_intercept(DISTANCE, 70 + 25 * np.log10(DISTANCE) + shadow)
        pairs = (
            (fit.exponent_interval, 2.5), (fit.shadowing_interval, 5), (line.intercept_interval, 70),
            (line.exponent_interval, 2.5),
        )  # fmt: skip
        held += [low < truth < high for (low, high), truth in pairs]
    # 95 % of 400 is 380 with a deviation of 4.4
    assert (np.abs(held - 380) < 4 * 4.4).all(), held


def test_too_few_positions_have_no_fit_or_no_interval():
    one = close_in(np.array([10.0]), np.array([100.0]), FREQUENCY)
    assert one.exponent == pytest.approx((100 - 74.8593) / 10, abs=1e-4)
    assert np.isnan(one.exponent_interval).all()
    for distance in (np.array([10.0]), np.array([10.0, 10.0, 10.0])):
        assert np.isnan(floating_intercept(distance, np.full(distance.size, 100.0)).exponent)
    empty = close_in(np.array([]), np.array([]), FREQUENCY)
    assert empty.positions == 0
    assert np.isnan(empty.exponent)


def test_positions_without_a_path_are_left_out():
    loss = free_space_path_loss(1.0, FREQUENCY) + 20 * np.log10(DISTANCE)
    loss[2] = np.nan
    fit = close_in(DISTANCE, loss, FREQUENCY)
    assert fit.positions == 5
    assert fit.exponent == pytest.approx(2.0)


def test_intervals_are_those_of_linear_regression():
    rng = np.random.default_rng(4)
    loss = 70 + 25 * np.log10(DISTANCE) + 5 * rng.normal(size=6)
    line = floating_intercept(DISTANCE, loss)
    known = stats.linregress(10 * np.log10(DISTANCE), loss)
    half = stats.t.ppf(0.975, 4) * np.array([known.stderr, known.intercept_stderr])
    for interval, value, wide in zip(
        (line.exponent_interval, line.intercept_interval), (known.slope, known.intercept), half, strict=True
    ):
        assert interval == pytest.approx((value - wide, value + wide), rel=1e-9)
    energy = 6 * line.shadowing**2
    assert line.shadowing_interval == pytest.approx(np.sqrt(energy / stats.chi2.ppf([0.975, 0.025], 4)), rel=1e-9)
