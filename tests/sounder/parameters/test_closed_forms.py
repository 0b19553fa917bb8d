"""Ten constructed channels have the parameters of their closed forms, to 1e-6; edge cases are as the sources say."""

from math import acos, cos, degrees, inf, log, nan, pi, radians, sin, sqrt

import numpy as np
import pytest

from erm.common.constants import c

from .channels import parameters, table

EQUAL = 10 * np.log10(2)


def spread(R):
    """Spreads by TR 38.901 and by Fleury [degree] of a mean vector of length R."""
    return degrees(sqrt(-2 * log(R))) if R else inf, degrees(sqrt(1 - R**2))


def check(mpcs, expected, **options):
    result = parameters(mpcs, **options)
    for name, value in expected.items():
        assert float(result[name]) == pytest.approx(value, rel=1e-6, abs=1e-15, nan_ok=True), name


def test_one_path():
    check(
        table((300e-9, 12.0, 3.0, -110.0)),
        {
            "path_loss": 110.0, "mpcs": 1, "rms_delay_spread": 0, "mean_excess_delay": 0, "maximum_excess_delay": 0,
            "coherence_bandwidth": inf, "azimuth_spread_arrival": 0, "azimuth_spread_arrival_fleury": 0,
            "zenith_spread_arrival": 0, "k_strongest": inf, "k_los": nan,
        },
    )  # fmt: skip


def test_no_path():
    result = parameters(table())
    assert float(result["mpcs"]) == 0
    others = [name for name in result.data_vars if name != "mpcs"]
    assert all(np.isnan(float(result[name])) for name in others)


def test_two_equal_paths():
    apart, turned = 40e-9, 60.0
    tr, fleury = spread(cos(radians(turned / 2)))
    check(
        table((100e-9, 350.0, 0.0, -100.0), (100e-9 + apart, 350.0 + turned - 360, 0.0, -100.0)),
        {
            "path_loss": 100.0 - EQUAL, "rms_delay_spread": apart / 2, "mean_excess_delay": apart / 2,
            "maximum_excess_delay": apart, "coherence_bandwidth": acos(0.5) / (pi * apart),
            "azimuth_spread_arrival": tr, "azimuth_spread_arrival_fleury": fleury, "k_strongest": 0.0,
        },
    )  # fmt: skip


def test_two_unequal_paths():
    """Shares p and q: S = T sqrt(p q), |C(f)|^2 = 1 - 4 p q sin^2(pi f T)."""
    apart, ratio = 75e-9, 10**0.3
    p, q = ratio / (1 + ratio), 1 / (1 + ratio)
    tr, fleury = spread(sqrt(1 - 4 * p * q * sin(radians(45)) ** 2))
    check(
        table((100e-9, 0.0, 0.0, -100.0), (175e-9, 90.0, 0.0, -103.0)),
        {
            "rms_delay_spread": apart * sqrt(p * q), "mean_excess_delay": apart * q, "k_strongest": 3.0,
            "coherence_bandwidth": np.arcsin(sqrt(0.75 / (4 * p * q))) / (pi * apart),
            "azimuth_spread_arrival": tr, "azimuth_spread_arrival_fleury": fleury,
        },
    )  # fmt: skip


def test_opposite_paths_cancel():
    check(
        table((100e-9, 10.0, 0.0, -100.0), (100e-9, 190.0, 0.0, -100.0)),
        {"azimuth_spread_arrival": inf, "azimuth_spread_arrival_fleury": degrees(1), "zenith_spread_arrival": 0},
    )


def test_four_paths_around_the_horizon_cancel():
    mpcs = table(*[(100e-9 + i * 10e-9, 90.0 * i + 7, 0.0, -100.0) for i in range(4)])
    expected = {"azimuth_spread_arrival": inf, "rms_delay_spread": 10e-9 * sqrt(1.25), "k_strongest": -10 * np.log10(3)}
    check(mpcs, expected)


def test_equally_spaced_equal_paths():
    """N paths T apart: S = T sqrt((N^2 - 1) / 12); over 2 pi / M in angle R = |sin(N x) / (N sin x)|, x = pi / M."""
    count, apart, step = 16, 5e-9, radians(7.0)
    tr, fleury = spread(sin(count * step / 2) / (count * sin(step / 2)))
    mpcs = table(*[(50e-9 + apart * i, (300 + 7 * i) % 360, 0.0, -90.0) for i in range(count)])
    check(
        mpcs,
        {
            "path_loss": 90 - 10 * np.log10(count), "rms_delay_spread": apart * sqrt((count**2 - 1) / 12),
            "maximum_excess_delay": 15 * apart, "azimuth_spread_arrival": tr, "azimuth_spread_arrival_fleury": fleury,
        },
    )  # fmt: skip


def test_a_path_above_and_one_below():
    tr, fleury = spread(cos(radians(12.0)))
    mpcs = table((100e-9, 0.0, 12.0, -100.0), (100e-9, 0.0, -12.0, -100.0))
    check(mpcs, {"zenith_spread_arrival": tr, "zenith_spread_arrival_fleury": fleury, "azimuth_spread_arrival": 0})


def test_an_exponential_profile():
    """Shares (1 - r) r^i at i T: mean T r / (1 - r), variance T^2 r / (1 - r)^2; |C|^2 = (1-r)^2 / |1 - r e^jx|^2."""
    r, apart = 0.8, 10e-9
    mpcs = table(*[(apart * i, 0.0, 0.0, -100 + 10 * i * np.log10(r)) for i in range(200)])
    x = acos((1 + r**2 - 4 * (1 - r) ** 2) / (2 * r))
    expected = {"mean_excess_delay": apart * r / (1 - r), "rms_delay_spread": apart * sqrt(r) / (1 - r)}
    check(mpcs, expected | {"coherence_bandwidth": x / (2 * pi * apart), "k_strongest": 10 * np.log10(0.2 / 0.8)})


def test_a_direct_path_weaker_than_a_reflection():
    mpcs = table((30 / c, 0.0, 0.0, -110.0), (200e-9, 90.0, 0.0, -100.0))
    check(mpcs, {"k_los": -10.0, "k_strongest": 10.0})
    check(mpcs, {"k_los": nan}, los=0)
    check(mpcs, {"k_los": nan}, distance=40.0)


def test_a_strong_path_keeps_the_correlation_up():
    """It cannot fall below 2 p - 1, here 0.6."""
    check(table((100e-9, 0.0, 0.0, -100.0), (175e-9, 0.0, 0.0, -106.0206)), {"coherence_bandwidth": inf})


def test_an_unknown_elevation_leaves_the_others_known():
    result = parameters(table((100e-9, 10.0, nan, -100.0), (200e-9, 50.0, nan, -100.0)))
    assert np.isnan(float(result["zenith_spread_arrival"]))
    assert float(result["azimuth_spread_arrival"]) == pytest.approx(spread(cos(radians(20)))[0])


def test_departure_is_computed_where_it_is_known():
    angles = {"departure_azimuth": [355.0, 5.0], "departure_elevation": [0.0, 0.0]}
    result = parameters(table((100e-9, 0.0, 0.0, -100.0), (200e-9, 0.0, 0.0, -100.0), **angles))
    assert float(result["azimuth_spread_departure"]) == pytest.approx(spread(cos(radians(5)))[0], rel=1e-6)
    assert float(result["zenith_spread_departure"]) == pytest.approx(0, abs=1e-12)
