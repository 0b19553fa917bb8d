"""The K-factor by moments is that of Rician fading."""

import numpy as np
import pytest

from sounder.parameters.k_factor import k_los, k_moments, k_strongest


@pytest.mark.parametrize("k", [0.0, 6.0, 12.0])
def test_moments_of_rician_fading(k):
    rng = np.random.default_rng(4)
    fading = rng.normal(size=(200_000, 2)) @ [1, 1j] / np.sqrt(2)
    power = np.abs(10 ** (k / 20) + fading) ** 2
    assert float(k_moments(power)) == pytest.approx(k, abs=0.15)
    assert float(k_moments(7.0 * power)) == pytest.approx(float(k_moments(power)), abs=1e-9)


def test_two_powers_have_a_closed_form():
    """Powers 1 and 3: M = 2, V = 2, K = sqrt(2) / (2 - sqrt(2))."""
    expected = 10 * np.log10(np.sqrt(2) / (2 - np.sqrt(2)))
    assert float(k_moments(np.array([1.0, 3.0]))) == pytest.approx(expected, rel=1e-9)


def test_edges():
    assert np.isposinf(k_moments(np.ones(5)))
    assert np.isneginf(k_moments(np.array([0.0, 0.0, 0.0, 1.0])))
    assert np.isnan(k_moments(np.ones(1)))
    assert np.isposinf(k_strongest(np.array([0.0, 1.0])))
    assert np.isnan(k_strongest(np.array([])))
    assert np.isnan(k_los(np.array([1.0, 1.0]), np.array([False, False])))
