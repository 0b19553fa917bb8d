"""What was found is told from what was made up, position by position, the short way round every circle."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from sounder.mpc.cramer_rao import UNITS
from sounder.mpc.score import Gates, score, with_snr


def table(rows, dim="mpc", **more):
    """Rows of delay [ns], azimuth, elevation [degree], path gain [dB]."""
    values = np.array(rows, float).reshape(-1, 4) * [1e-9, 1, 1, 1]
    columns = {name: (dim, values[:, i]) for i, name in enumerate(UNITS)}
    return xr.Dataset(columns | {name: (dim, np.asarray(value)) for name, value in more.items()})


TRUTH = [(100, 10, 1, -100), (130, 200, 0, -105), (130.5, 90, 2, -110), (180, 359, -3, -118)]


def test_truth_scores_itself():
    judged = score(table(TRUTH), table(TRUTH, "path"))
    assert judged.detection == 1.0
    assert judged.false_share == 0.0
    assert judged.paths["match"].values.tolist() == [0, 1, 2, 3]
    for name in UNITS:
        assert (judged.paths[f"{name}_error"] == 0).all()


@settings(max_examples=50, deadline=None)
@given(st.permutations(range(4)), st.permutations(range(4)), st.floats(0, 360))
@pytest.mark.slow
def test_neither_order_nor_north_matters(theirs, ours, north):
    rng = np.random.default_rng(2)
    truth = np.array(TRUTH, float) + np.array([0, north, 0, 0])
    found = truth + rng.normal(0, [0.2, 1.0, 1.0, 1.0], (4, 4))
    truth[:, 1] %= 360
    judged = score(table(found[list(ours)]), table(truth[list(theirs)], "path"))
    for i, name in enumerate(UNITS):
        expected = (found - np.array(TRUTH) - [0, north, 0, 0])[theirs, i] * (1e-9 if name == "delay" else 1)
        np.testing.assert_allclose(judged.paths[f"{name}_error"], expected, atol=1e-9 if i else 1e-17)


def test_missed_and_false():
    found = [(100.1, 11, 1, -101), (133, 200, 0, -105), (130.5, 96, 2, -110), (180, 2, -3, -129)]
    judged = score(table(found), table(TRUTH, "path"))
    # 3 ns late, 6 degrees aside and 11 dB weak are other things
    assert judged.paths["match"].values.tolist() == [0, -1, -1, -1]
    assert judged.estimates["match"].values.tolist() == [0, -1, -1, -1]
    wide = score(table(found), table(TRUTH, "path"), gates=Gates(delay=4e-9, azimuth=7, path_gain=12))
    assert wide.detection == 1.0
    # 2 degrees is 3 beyond 359
    assert float(wide.paths["azimuth_error"][3]) == pytest.approx(3.0)


def test_elevation_counts_when_it_has_a_gate():
    truth, found = table(TRUTH, "path"), table(np.array(TRUTH, float) + np.array([0, 0, 8, 0]))
    assert score(found, truth).detection == 1.0
    assert score(found, truth, gates=Gates(elevation=5)).detection == 0.0
    unknown = found.assign(elevation=("mpc", np.full(4, np.nan)))
    assert score(unknown, truth, gates=Gates(elevation=5)).detection == 1.0


def test_one_mpc_finds_one_path():
    """Two paths inside the gates of one MPC: one is missed; two MPCs on one path: one is false."""
    pair = [(100, 10, 0, -100), (100.4, 11, 0, -101)]
    merged = score(table([(100.1, 10.2, 0, -99)]), table(pair, "path"))
    assert merged.detection == 0.5
    assert merged.paths["match"].values.tolist() == [0, -1]
    split = score(table(pair), table(pair[:1], "path"))
    assert split.false_share == 0.5
    assert split.estimates["match"].values.tolist() == [0, -1]


def test_assignment_finds_the_most_pairs():
    """The first MPC is nearest to the first path, but is the only one for the second: greedy matching would lose it."""
    truth = table([(100, 10, 0, -100), (101.4, 10, 0, -100)], "path")
    found = table([(100.45, 10, 0, -100), (99.2, 10, 0, -100)])
    assert score(found, truth).paths["match"].values.tolist() == [1, 0]


def test_weak_paths_need_not_be_found_but_may_be():
    truth = table([*TRUTH, (300, 120, 0, -130), (400, 120, 0, -140)], "path")
    found = table([*TRUTH, (300, 120, 0, -131)])
    judged = score(found, truth)  # 25 dB under the strongest is -125
    assert judged.paths["required"].values.tolist() == [True] * 4 + [False] * 2
    assert judged.detection == 1.0
    assert judged.false_share == 0.0
    assert score(found, truth, dynamic_range=45).detection == pytest.approx(5 / 6)
    noisy = truth.assign(snr=("path", [30.0, 25, 20, 9, 5, 0]))
    assert score(found, noisy).paths["required"].values.tolist() == [True] * 3 + [False] * 3
    given_ = noisy.assign(required=("path", [False] * 5 + [True]))
    assert score(found, given_).detection == 0.0


def test_a_weak_neighbour_takes_no_mpc_from_a_required_path():
    truth = table([(100, 10, 0, -100), (100.3, 10, 0, -129)], "path")
    judged = score(table([(100.25, 10, 0, -101)]), truth, gates=Gates(path_gain=np.inf))
    assert judged.paths["match"].values.tolist() == [0, -1]


def test_delays_modulo_the_period():
    truth, period = table([(900, 10, 0, -100)], "path"), 851e-9
    found = table([(49.2, 10, 0, -100)])
    assert score(found, truth).detection == 0.0
    judged = score(found, truth, period=period)
    assert judged.detection == 1.0
    assert float(judged.paths["delay_error"][0]) == pytest.approx(0.2e-9, abs=1e-15)


def test_positions_are_apart():
    truth = table([*TRUTH, *TRUTH], "path", position=["A"] * 4 + ["B"] * 4)
    found = table(TRUTH, position=["B"] * 4)
    judged = score(found, truth)
    assert judged.paths["match"].values.tolist() == [-1] * 4 + [0, 1, 2, 3]
    assert judged.summary()["positions"] == 2
    elsewhere = score(table(TRUTH, position=["C"] * 4), truth)
    assert elsewhere.false_share == 1.0


def test_nothing_found_and_nothing_there():
    silent = score(table([]), table(TRUTH, "path"))
    assert silent.detection == 0.0
    assert np.isnan(silent.false_share)
    empty = score(table(TRUTH), table([], "path"))
    assert empty.false_share == 1.0
    assert np.isnan(empty.detection)
    assert empty.summary()["errors"]["delay"]["count"] == 0


@pytest.mark.slow
def test_errors_and_their_honesty():
    """Normal errors with the deviation that is told: 68 % within one, 95 % within two, and the RMS is the deviation."""
    rng = np.random.default_rng(11)
    count = 2000
    truth = np.column_stack([10.0 * np.arange(count), rng.uniform(0, 360, count), np.zeros(count), np.full(count, -90)])
    std = np.array([0.1, 0.5, 0.7, 0.6])
    found = truth + rng.standard_normal((count, 4)) * std
    told = {f"{name}_std": np.full(count, std[i] * (1e-9 if i == 0 else 1)) for i, name in enumerate(UNITS)}
    summary = score(table(found, **told), table(truth, "path")).summary()
    assert summary["detection"] == 1.0
    for i, name in enumerate(UNITS):
        row = summary["errors"][name]
        # a share's deviation is sqrt(0.68 * 0.32 / 2000) = 1 %, the RMS's 1 / sqrt(4000) = 1.6 %; four of each
        assert row["within_1_std"] == pytest.approx(0.683, abs=0.042)
        assert row["within_2_std"] == pytest.approx(0.954, abs=0.019)
        assert row["rmse"] == pytest.approx(std[i] * (1e-9 if i == 0 else 1), rel=0.064)


def test_separation_is_in_gates():
    truth = table([(100, 10, 0, -100), (101, 10, 0, -101), (100, 25, 0, -100), (100.1, 10, 0, -150)], "path")
    separation = score(table([]), truth, dynamic_range=60).paths["separation"].values
    np.testing.assert_allclose(separation[:3], [1.0, 1.0, 3.0])  # the fourth is too weak to be in anyone's way
    assert separation[3] == pytest.approx(0.1)


def test_snr_is_that_of_the_best_recorded_beam(bench):
    azimuth, elevation = np.array(bench.sounder.scan.azimuth), np.array(bench.sounder.scan.elevation)
    noise = np.full((36, 3), -120.0)
    daps = xr.Dataset({"noise_floor": (("azimuth", "elevation"), noise)}, {"azimuth": azimuth, "elevation": elevation})
    truth = table([(100, 40, 9, -100)], "path")
    seen = with_snr(truth, daps, bench.sounder)
    assert float(seen["snr"][0]) == pytest.approx(-100 + 24.5 + 120)
    assert float(seen["beam_gain"][0]) == pytest.approx(0.0)
    noise[4, 2] = np.nan  # the half-power beam 9 degrees under it is next: 12 dB down
    aside = with_snr(truth, daps, bench.sounder)
    assert -14 < float(aside["beam_gain"][0]) < -10
