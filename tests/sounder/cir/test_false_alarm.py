"""The level that noise exceeds at a stated rate."""

import numpy as np
import pytest
from scipy.special import gammaln

from sounder.cir.false_alarm import NOISE_QUANTILE, false_alarm_level, quantile_of_noise
from sounder.cir.power_spectrum import noise_power


@pytest.mark.parametrize(("samples", "cells"), [(64, 1e4), (508, 1e5), (20_000, 1e7)])
def test_one_look_is_the_closed_form_of_order_statistic_cfar(samples, cells):
    """Rohling, 1983: prod_i (n - i) / (n - i + T) for T times the k-th of n exponential powers."""
    k = NOISE_QUANTILE * samples
    t = false_alarm_level(0.05, int(cells), samples) / quantile_of_noise()
    log = gammaln(samples + 1) - gammaln(samples - k + 1) + gammaln(samples - k + 1 + t) - gammaln(samples + 1 + t)
    assert np.exp(log) * cells == pytest.approx(0.05, rel=1e-3)


@pytest.mark.parametrize("looks", [1, 8])
def test_noise_exceeds_the_level_as_often_as_stated(looks):
    """400 beams of 255 samples, 20 times over: 30 a scan, each beam over its own estimate of the noise."""
    rng = np.random.default_rng(3)
    power = rng.gamma(looks, 1 / looks, (20, 400, 255))
    level = false_alarm_level(30.0, 400 * 255, 255, looks)
    exceeded = np.sum(power > level * noise_power(power, looks)[..., None])
    assert exceeded == pytest.approx(600, abs=4 * np.sqrt(600))
    assert noise_power(power, looks).mean() == pytest.approx(1.0, abs=0.02)
