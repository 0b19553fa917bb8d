"""`sounder score` tells how well a simulated position was processed, from any form of the truth."""

import json

import numpy as np
import pytest
from PIL import Image

from erm.mpc_table import make_table, read_product, write_csv
from erm.storage import open_group
from sounder.cli import main

SOUNDER = """
name = "small"
[waveform]
order = 7
polynomial = [7, 1, 0]
chip_rate = 500e6
samples_per_chip = 2
sample_rate = 1e9
[carrier]
frequency = 60e9
lo_frequency = 60e9
multiplier = 1
if_frequency = 0.0
[tx_antenna]
gain = 20
pattern = "flat"
[rx_antenna]
gain = 15
hpbw_azimuth = 30
hpbw_elevation = 30
[scan]
azimuth = [0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330]
elevation = [-15, 15]
[transmitter]
power = -20
"""
SCENE = """
name = "corner"
sounder = "sounder.toml"
attenuator = 60.0
snapshots = 4
max_order = 1
[transmitters]
TX = [4, 5, 2]
[[receivers]]
name = "RX1"
tx = "TX"
position = [12, 3, 1.5]
[[receivers]]
name = "RX2"
tx = "TX"
position = [14, 6, 1.5]
[[environment.walls]]
points = [[0, 0], [20, 0], [20, 10]]
material = "metal"
"""


def run(monkeypatch, *args):
    monkeypatch.setattr("sys.argv", ["sounder", *map(str, args)])
    try:
        main()
    except SystemExit as stop:
        return stop.code
    return 0


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("score")
    (folder / "sounder.toml").write_text(SOUNDER)
    (folder / "scene.toml").write_text(SCENE)
    with pytest.MonkeyPatch.context() as monkeypatch:
        assert run(monkeypatch, "simulate", folder / "scene.toml", "--out", folder) == 0
        calibration = "--calibration", folder / "back-to-back.h5"
        raw = sorted((folder / "raw").glob("*.h5"))
        assert run(monkeypatch, "process", *raw, *calibration, "--out", folder / "products") == 0
    return folder


@pytest.fixture
def products(campaign):
    return sorted((campaign / "products").glob("*.h5"))


def summary(monkeypatch, capsys, *args):
    capsys.readouterr()
    code = run(monkeypatch, "score", *args, "--json")
    return code, json.loads(capsys.readouterr().out)


def test_simulated_paths_are_found(campaign, products, monkeypatch, capsys):
    code, found = summary(monkeypatch, capsys, *products, "--truth", campaign / "truth" / "paths.h5")
    assert code == 0
    assert found["positions"] == 2
    # direct path and two walls at each; far above the noise and the resolution of 2 ns and 15 degrees
    assert found["paths"] == 6
    assert found["detection"] == 1.0
    assert found["errors"]["delay"]["rmse"] < 0.1e-9
    assert found["errors"]["azimuth"]["rmse"] < 1.0
    assert found["gates"]["elevation"] is None


def test_truth_as_a_table_or_a_product_says_the_same(campaign, products, monkeypatch, capsys, tmp_path):
    truth = open_group(campaign / "truth" / "paths.h5")
    ends = {"tx_position": [4, 5, 2], "rx_position": [12, 3, 1.5], "frequency": 60e9}
    first = truth.isel(path=np.flatnonzero(truth["position"].values == "RX1"))
    names = ("position", "delay", "azimuth", "elevation", "path_gain")
    write_csv(make_table(ends | {name: first[name].values for name in names}), tmp_path / "truth.csv")
    direct = summary(monkeypatch, capsys, products[0], "--truth", campaign / "truth" / "paths.h5")
    assert summary(monkeypatch, capsys, products[0], "--truth", tmp_path / "truth.csv") == direct

    code, itself = summary(monkeypatch, capsys, products[0], "--truth", products[0], "--dynamic-range", 200)
    assert code == 0
    assert itself["detection"] == 1.0
    assert itself["errors"]["delay"]["rmse"] == 0.0


def test_mpcs_of_others_are_scored_too(campaign, products, monkeypatch, capsys, tmp_path):
    write_csv(read_product(products[0])[0], tmp_path / "theirs.csv")
    code, found = summary(monkeypatch, capsys, tmp_path / "theirs.csv", "--truth", campaign / "truth" / "paths.h5")
    assert code == 0
    assert found["paths"] == 3


def test_table_and_figures(campaign, products, monkeypatch, capsys, tmp_path):
    truth = campaign / "truth" / "paths.h5"
    assert run(monkeypatch, "score", *products, "--truth", truth, "--out", tmp_path / "score") == 0
    text = capsys.readouterr().out
    assert "6 of 6 paths found" in text
    assert "delay [s]" in text
    lines = (tmp_path / "score" / "paths.csv").read_text().splitlines()
    assert lines[0].startswith("position,delay,azimuth,elevation,path_gain,snr,required,separation,match,delay_error")
    assert len(lines) == 1 + open_group(truth).sizes["path"]
    for name in ("against_snr.png", "against_separation.png"):
        with Image.open(tmp_path / "score" / name) as picture:
            assert picture.size[0] > 1000


def test_what_cannot_be_scored_is_named_and_the_rest_is(campaign, products, monkeypatch, capsys, tmp_path):
    truth = campaign / "truth" / "paths.h5"
    other = tmp_path / "other.csv"
    ends = {"tx_position": [4, 5, 2], "rx_position": [12, 3, 1.5], "frequency": 60e9}
    write_csv(make_table({"position": "P99", "delay": [40e-9], "azimuth": [1.0], "path_gain": [-90.0], **ends}), other)
    assert run(monkeypatch, "score", products[0], other, tmp_path / "none.h5", "--truth", truth) == 1
    told = capsys.readouterr()
    assert "3 of 3 paths found" in told.out
    assert "P99 is not in" in told.err
    assert "none.h5: no such file" in told.err
    assert run(monkeypatch, "score", products[0], "--truth", tmp_path / "none.h5") == 1
    assert run(monkeypatch, "score", products[0], "--truth", campaign / "back-to-back.h5") == 1
    assert "Traceback" not in capsys.readouterr().err
