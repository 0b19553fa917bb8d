"""`sounder convert`: any readable file becomes native recordings."""

import h5py
import numpy as np
import pytest
import xarray as xr

from .commands import group, names, run


@pytest.mark.slow
def test_convert_makes_native_recordings_of_a_foreign_file(campaign, products, joined, tmp_path):
    layout = ("--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml")
    assert run("convert", joined, *layout, "--out", tmp_path / "native") == 0
    assert names(tmp_path / "native") == ["P0.h5", "P1.h5", "back-to-back.h5"]
    native = tmp_path / "native"
    assert run("process", native / "P1.h5", "--calibration", native / "back-to-back.h5", "--out", tmp_path / "out") == 0
    xr.testing.assert_identical(group(products / "RX2.h5", "/mpc"), group(tmp_path / "out" / "P1.h5", "/mpc"))
    # one native recording to another, byte by byte but for its history
    assert run("convert", campaign / "raw" / "RX1.h5", "--out", tmp_path / "one.h5") == 0
    with h5py.File(tmp_path / "one.h5") as one, h5py.File(campaign / "raw" / "RX1.h5") as other:
        assert one.keys() == other.keys()
        for name in one:
            assert np.array_equal(one[name][()], other[name][()])


def test_convert_refuses_many_positions_in_one_file(campaign, joined, tmp_path, capsys):
    layout = ("--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml")
    assert run("convert", joined, *layout, "--out", tmp_path / "one.h5") == 1
    assert "holds 2 positions and a back-to-back; --out is the file" in capsys.readouterr().err
    assert not (tmp_path / "one.h5").exists()
