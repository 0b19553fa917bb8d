"""`sounder score` compares MPCs with the truth in any form."""

import json

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from erm.common.errors import DataError
from erm.common.storage import open_group, write_product
from erm.mpcs.files import read_product, write_mpcs
from erm.mpcs.table import make_table
from sounder.processing.scoring import read_truth

from .commands import run


@pytest.fixture
def processed(products):
    return sorted(products.glob("*.h5"))


def summary(capsys, *args):
    capsys.readouterr()
    code = run("score", *args, "--json")
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_simulated_paths_are_found(campaign, processed, capsys):
    code, found = summary(capsys, *processed, "--truth", campaign / "truth" / "paths.h5")
    assert code == 0
    assert found["positions"] == 2
    # direct path and four walls at each; far above the noise and the resolution of 2 ns and 15 degrees
    assert found["paths"] == 10
    assert found["detection"] == 1.0
    assert found["errors"]["delay"]["rmse"] < 0.1e-9
    assert found["errors"]["azimuth"]["rmse"] < 1.0
    assert found["gates"]["elevation"] is None


@pytest.mark.slow
def test_truth_as_a_table_or_a_product_says_the_same(campaign, processed, capsys, tmp_path):
    truth = open_group(campaign / "truth" / "paths.h5")
    ends = {"tx_position": [4, 5, 3], "rx_position": [12, 3, 1.5], "frequency": 60e9}
    first = truth.isel(path=np.flatnonzero(truth["position"].values == "RX1"))
    names = ("position", "delay", "azimuth", "elevation", "path_gain")
    write_mpcs(make_table(ends | {name: first[name].values for name in names}), tmp_path / "truth.csv")
    direct = summary(capsys, processed[0], "--truth", campaign / "truth" / "paths.h5")
    assert summary(capsys, processed[0], "--truth", tmp_path / "truth.csv") == direct

    code, itself = summary(capsys, processed[0], "--truth", processed[0], "--dynamic-range", 200)
    assert code == 0
    assert itself["detection"] == 1.0
    assert itself["errors"]["delay"]["rmse"] == 0.0


@pytest.mark.slow
def test_mpcs_of_others_are_scored_too(campaign, processed, capsys, tmp_path):
    write_mpcs(read_product(processed[0])[0], tmp_path / "theirs.csv")
    code, found = summary(capsys, tmp_path / "theirs.csv", "--truth", campaign / "truth" / "paths.h5")
    assert code == 0
    assert found["paths"] == 5


@pytest.mark.slow
def test_table_and_figures(campaign, processed, capsys, tmp_path):
    truth = campaign / "truth" / "paths.h5"
    assert run("score", *processed, "--truth", truth, "--out", tmp_path / "score") == 0
    text = capsys.readouterr().out
    assert "10 of 10 paths found" in text
    assert "delay [s]" in text
    lines = (tmp_path / "score" / "paths.csv").read_text().splitlines()
    assert lines[0].startswith("position,delay,azimuth,elevation,path_gain,snr,required,separation,match,delay_error")
    assert len(lines) == 1 + open_group(truth).sizes["path"]
    for name in ("against_snr.png", "against_separation.png"):
        with Image.open(tmp_path / "score" / name) as picture:
            assert picture.size[0] > 1000


@pytest.mark.slow
def test_what_cannot_be_scored_is_named_and_the_rest_is(campaign, processed, capsys, tmp_path):
    truth = campaign / "truth" / "paths.h5"
    other = tmp_path / "other.csv"
    ends = {"tx_position": [4, 5, 3], "rx_position": [12, 3, 1.5], "frequency": 60e9}
    write_mpcs(make_table({"position": "P99", "delay": [40e-9], "azimuth": [1.0], "path_gain": [-90.0], **ends}), other)
    assert run("score", processed[0], other, tmp_path / "none.h5", "--truth", truth) == 1
    shown = capsys.readouterr()
    assert "5 of 5 paths found" in shown.out
    assert "P99 is not in" in shown.err
    assert "none.h5: no such file" in shown.err
    assert run("score", processed[0], "--truth", tmp_path / "none.h5") == 1
    assert run("score", processed[0], "--truth", campaign / "back-to-back.h5") == 1
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    "wrong", [("--delay-gate", "nan"), ("--azimuth-gate", "-1"), ("--gain-gate", "0"), ("--dynamic-range", "nan")]
)
@pytest.mark.slow
def test_gates_that_let_nothing_through_are_wrong_usage(campaign, processed, capsys, wrong):
    assert run("score", processed[0], "--truth", campaign / "truth" / "paths.h5", *wrong) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"is {wrong[1]}" in line


def test_truth_beyond_all_measure_is_refused_by_name(tmp_path):
    names = ("delay", "azimuth", "elevation", "path_gain")
    paths = {"position": ("path", ["RX1"])} | {
        name: ("path", [-np.inf if name == "path_gain" else 0.0]) for name in names
    }
    for name in names:
        write_product({"/": xr.Dataset(paths | {name: ("path", [np.inf])})}, tmp_path / "t.h5")
        with pytest.raises(DataError, match=rf"t\.h5: {name} is inf; expected -"):
            read_truth(tmp_path / "t.h5")
    write_product({"/": xr.Dataset(paths)}, tmp_path / "t.h5")
    assert read_truth(tmp_path / "t.h5")[0].sizes["path"] == 1
