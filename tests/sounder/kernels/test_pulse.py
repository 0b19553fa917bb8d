"""A pulse of known shape between the samples."""

import numba
import numpy as np

from sounder.kernels import pulse

OVER = 64
REACH = 20
SIZE = 200


@numba.njit
def pulse_at(*arguments):
    return pulse.pulse_at(*arguments)


@numba.njit
def amplitude_at(*arguments):
    return pulse.amplitude_at(*arguments)


@numba.njit
def fit_delay(*arguments):
    return pulse.fit_delay(*arguments)


@numba.njit
def add_pulse(*arguments):
    pulse.add_pulse(*arguments)


def shape(t):
    """Hann-windowed band of 0.9 of the sample rate: three sinc pulses."""
    x = 0.9 * np.asarray(t)
    return np.sinc(x) + 0.5 * (np.sinc(x - 1) + np.sinc(x + 1))


TABLE = shape(np.arange(-REACH * OVER, REACH * OVER + 1) / OVER).astype(complex)


def row_of(delay, amplitude=1.0):
    late = (np.arange(SIZE) - delay + SIZE / 2) % SIZE - SIZE / 2
    return (amplitude * shape(late)).astype(np.complex64)


def test_table_is_exact_on_its_points_and_linear_between():
    assert pulse_at(TABLE, OVER, 0.0) == 1
    assert pulse_at(TABLE, OVER, 1 + 1 / OVER) == TABLE[(REACH + 1) * OVER + 1]
    for offset in np.random.default_rng(1).uniform(-REACH, REACH, 100):
        # linear interpolation errs by h^2/8 times the curvature, at most (0.9 pi)^2
        assert abs(pulse_at(TABLE, OVER, offset) - shape(offset)) < (0.9 * np.pi / OVER) ** 2 / 8
    for beyond in (-REACH - 0.01, REACH + 0.01, 1e6):
        assert pulse_at(TABLE, OVER, beyond) == 0


def test_amplitude_and_phase_are_fitted_anywhere_on_the_circle():
    rng = np.random.default_rng(2)
    for delay in [0.0, 0.4, SIZE - 0.4, *rng.uniform(0, SIZE, 50)]:
        amplitude = rng.uniform(0.1, 10) * np.exp(2j * np.pi * rng.random())
        got = amplitude_at(row_of(delay, amplitude), TABLE, OVER, delay)
        assert abs(got / amplitude - 1) < 3e-4  # the table's error, as above


def test_delay_is_fitted_from_a_sample_away():
    rng = np.random.default_rng(3)
    for delay in [0.1, SIZE - 0.3, *rng.uniform(0, SIZE, 100)]:
        amplitude = np.exp(2j * np.pi * rng.random())
        got = fit_delay(row_of(delay, amplitude), TABLE, OVER, float(round(delay)))
        # kinks of the linear table move the last parabola's vertex by less than a tenth of a table step
        assert abs(got - delay) < 0.1 / OVER


def test_fit_goes_no_further_than_a_sample():
    for start in (50.0, 53.0):
        got = fit_delay(row_of(60.0), TABLE, OVER, start)
        assert abs(got - start) <= 1


def test_what_is_added_is_taken_away_and_wraps():
    for delay in (0.0, 3.3, SIZE - 0.7):
        row = np.zeros(SIZE, np.complex64)
        add_pulse(row, TABLE, OVER, delay, 2j)
        late = np.abs((np.arange(SIZE) - delay + SIZE / 2) % SIZE - SIZE / 2)
        expected = np.where(late <= REACH, row_of(delay, 2j), 0)
        np.testing.assert_allclose(row, expected, atol=2 * (0.9 * np.pi / OVER) ** 2 / 8)
        add_pulse(row, TABLE, OVER, delay, -2j)
        np.testing.assert_allclose(row, 0, atol=1e-6)
