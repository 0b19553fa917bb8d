"""Statistics of a campaign: quantiles and their intervals, groups apart, fits."""

import numpy as np
import pytest
import xarray as xr

from sounder.parameters.statistics import campaign_statistics, quantile


def campaign(los, **columns) -> xr.Dataset:
    count = len(los)
    facts = {"los": los, "frequency": np.full(count, 132e9), "distance": np.geomspace(10, 100, count)}
    facts |= {"path_loss": np.full(count, np.nan), "definition": ["from MPCs"] * count}
    return xr.Dataset({name: ("position", values) for name, values in (facts | columns).items()})


@pytest.mark.slow
def test_intervals_hold_the_quantile_at_least_as_often_as_they_say():
    rng = np.random.default_rng(2)
    for count, share in ((25, 0.5), (60, 0.1), (60, 0.9)):
        truth = -np.log1p(-share)
        held = 0
        for _ in range(500):
            _, low, high = quantile(rng.exponential(size=count), share)
            held += low <= truth <= high
        assert held > 0.95 * 500 - 4 * np.sqrt(500 * 0.05 * 0.95)


def test_small_and_infinite_samples():
    assert np.isnan(quantile(np.array([3.0]), 0.5)[1:]).all()
    assert quantile(np.array([3.0]), 0.9)[0] == 3.0
    assert quantile(np.array([1.0, np.inf, np.inf]), 0.5)[0] == np.inf
    assert quantile(np.array([1.0, 2.0, np.inf]), 0.5)[0] == 2.0
    assert quantile(np.array([np.inf, np.inf]), 0.5)[0] == np.inf


def test_groups_are_apart():
    delay = np.array([10, 20, 30, 100, 300, 500]) * 1e-9
    statistics = campaign_statistics(campaign([1, 1, 1, 0, 0, 0], rms_delay_spread=delay))
    found = {(one.group, one.statistic): one for one in statistics}
    assert {one.group for one in statistics} == {"LoS", "NLoS", "all"}
    assert found["LoS", "median"].value == pytest.approx(20e-9)
    assert found["NLoS", "p90"].value == pytest.approx(460e-9)
    assert found["all", "median"].value == pytest.approx(65e-9)
    # of TR 38.901, Table 7.5-6: of lg(DS / 1 s)
    assert found["LoS", "lg_mean"].value == pytest.approx(np.log10([1e-8, 2e-8, 3e-8]).mean())
    assert found["LoS", "median"].definition.endswith("ITU-R P.1407 2.2.3; from MPCs")


def test_unknown_values_do_not_count():
    statistics = campaign_statistics(campaign([1, 1, 1], rms_delay_spread=[np.nan, 1e-8, 3e-8]))
    found = {(one.parameter, one.statistic): one for one in statistics}
    assert found["rms_delay_spread", "mean"].positions == 2
    assert not any(one.parameter.startswith("path_loss") for one in statistics)


def test_fits_are_among_the_statistics():
    made = campaign([1] * 5)
    made["path_loss"] = 80 + 30 * np.log10(made["distance"])
    found = {(one.parameter, one.statistic): one for one in campaign_statistics(made)}
    assert found["path_loss_floating_intercept", "exponent"].value == pytest.approx(3.0)
    assert found["path_loss_floating_intercept", "intercept"].value == pytest.approx(80.0)
    assert found["path_loss_close_in", "exponent"].positions == 5


def test_doubtful_positions_do_not_count():
    made = campaign([1, 1, 1], rms_delay_spread=[1e-8, 2e-8, 9e-8], doubts=["", "", "delay path_gain"])
    found = {(one.parameter, one.statistic): one for one in campaign_statistics(made)}
    assert found["rms_delay_spread", "p90"].positions == 2
    assert found["rms_delay_spread", "mean"].value == pytest.approx(1.5e-8)
