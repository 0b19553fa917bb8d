"""Outputs never replace inputs or one another."""

import shutil

import h5py
import pytest

from .commands import digest, names, run


def test_a_product_never_replaces_its_recording(copied, capsys):
    before = digest(copied)
    assert run("process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5", "--out", copied) == 1
    assert "is an input; choose another --out" in capsys.readouterr().err
    assert digest(copied) == before
    assert run("convert", copied / "RX1.h5", "--out", copied / "RX1.h5") == 2
    assert digest(copied) == before


@pytest.mark.parametrize("name", ["back-to-back", "RX2"])
def test_a_product_never_replaces_another_input(copied, capsys, name):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file.attrs["position"] = name
    before = digest(copied)
    recordings = (copied / "RX1.h5", copied / "RX2.h5")
    assert run("process", *recordings, "--calibration", copied / "back-to-back.h5", "--out", copied) == 1
    assert f"position {name}: the output" in capsys.readouterr().err
    assert {key: value for key, value in digest(copied).items() if key in before} == before


@pytest.mark.slow
def test_two_positions_of_one_name_are_reported(copied, capsys):
    shutil.copy(copied / "RX1.h5", copied / "copy.h5")
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", copied / "copy.h5", "--calibration", b2b, "--out", copied / "out") == 1
    assert "RX1.h5 is already taken by" in capsys.readouterr().err
    assert names(copied / "out") == ["RX1.h5"]


def test_a_folder_that_cannot_be_written_is_reported(copied, capsys):
    (copied / "file").write_text("in the way")
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / "file") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("file: is a file; choose a folder to write into")
    for name in ("out.h5", "out.csv"):
        assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / name) == 2
        assert "looks like a file; choose a folder" in capsys.readouterr().err
