"""Clusters of MPCs that are apart are found; spreads within and between them add to the whole."""

import numpy as np
import pytest

from sounder.parameters.clusters import cluster_spreads, dbscan, find_clusters, k_power_means
from sounder.parameters.delay import rms_delay_spread
from sounder.parameters.multipath_distance import features

from .channels import parameters, random_table, table


def two_clusters():
    """4 ns and 8 degree wide, 200 ns and 100 degree apart, the first twice as strong."""
    return table(
        (100e-9, 356.0, 0.0, -100.0),
        (104e-9, 4.0, 0.0, -100.0),
        (300e-9, 96.0, 0.0, -100.0 - 10 * np.log10(2)),
        (304e-9, 104.0, 0.0, -100.0 - 10 * np.log10(2)),
    )


def test_the_distance_is_that_of_czink():
    """Half the chord of the directions, and zeta |dt| s / D^2 of the delays, here with D = 100 ns and s = 50 ns."""
    points = features(np.array([0.0, 100e-9]), np.array([0.0, 60.0]), np.zeros(2))
    assert np.linalg.norm(points[0] - points[1]) == pytest.approx(np.hypot(np.sin(np.radians(30)), 5 * 0.5))


def test_closed_forms_of_two_clusters():
    result = parameters(two_clusters(), clusters="k-power-means")
    p, q = 2 / 3, 1 / 3
    expected = {"clusters": 2, "cluster_delay_spread": 2e-9, "inter_cluster_delay_spread": 200e-9 * np.sqrt(p * q)}
    expected["cluster_azimuth_spread"] = np.degrees(np.sqrt(-2 * np.log(np.cos(np.radians(4)))))
    R = np.sqrt(1 - 4 * p * q * np.sin(np.radians(50)) ** 2)
    expected["inter_cluster_azimuth_spread"] = np.degrees(np.sqrt(-2 * np.log(R)))
    for name, value in expected.items():
        assert float(result[name]) == pytest.approx(value, rel=1e-6), name


@pytest.mark.parametrize("method", ["k-power-means", "dbscan"])
@pytest.mark.parametrize("seed", range(4))
def test_clusters_that_are_apart_are_found_and_turn_with_the_channel(method, seed):
    if method == "dbscan":
        pytest.importorskip("sklearn", reason="the extra clusters is not installed")
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 7))
    truth = np.repeat(np.arange(count), 8)
    azimuth = (360 / count * truth + rng.uniform(-4, 4, truth.size)) % 360
    delay = 100e-9 * (1 + rng.permutation(count))[truth] + rng.uniform(0, 3e-9, truth.size)
    power = 10 ** rng.uniform(-12, -11, truth.size)
    labels = find_clusters(delay, azimuth, np.zeros(truth.size), power, method)
    assert len(set(zip(truth.tolist(), labels.tolist(), strict=True))) == count == labels.max() + 1
    turned = find_clusters(delay, (azimuth + 123) % 360, np.zeros(truth.size), 1e3 * power, method)
    assert turned.tolist() == labels.tolist()
    strength = [power[labels == k].sum() for k in range(count)]
    assert strength == sorted(strength, reverse=True)


def test_squared_spreads_within_and_between_add():
    rng = np.random.default_rng(5)
    mpcs = random_table(rng, 30)
    columns = [mpcs[name].values for name in ("delay", "azimuth", "elevation")]
    power = 10 ** (mpcs["path_gain"].values / 10)
    spreads = cluster_spreads(*columns, power, find_clusters(*columns, power))
    parts = np.hypot(spreads["cluster_delay_spread"], spreads["inter_cluster_delay_spread"])
    assert parts == pytest.approx(float(rms_delay_spread(columns[0], power)), rel=1e-9)


def test_few_paths_are_a_cluster_each():
    for count in (0, 1, 2):
        labels = k_power_means(np.arange(4.0 * count).reshape(count, 4), np.ones(count))
        assert sorted(labels.tolist()) == list(range(count))
    assert k_power_means(np.zeros((3, 4)), np.ones(3)).tolist() == [0, 0, 0]
    assert float(parameters(table(), clusters="k-power-means")["clusters"]) == 0


def test_dbscan_says_what_it_needs(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    with pytest.raises(ValueError, match="DBSCAN needs sklearn, which is not installed; pip install"):
        dbscan(np.zeros((2, 4)), np.ones(2))


def test_strong_paths_hold_the_centroids():
    """The path at 4.1 joins 9 because the strong one at 0 keeps its centroid at 0.4; unweighted it would be at 2.05."""
    points = np.array([[0.0], [4.1], [5.0], [9.0]])
    assert k_power_means(points, np.array([10.0, 1.0, 1.0, 2.0]), number=2).tolist() == [0, 1, 1, 1]
