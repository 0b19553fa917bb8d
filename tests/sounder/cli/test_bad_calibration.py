"""A back-to-back, layout or description that does not fit is reported in one line."""

from pathlib import Path

import h5py
import pytest

from sounder.processing.summary import describe_file

from .commands import SCENE, SOUNDER, names, run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("replaced", "expected"),
    [
        (("polynomial = [7, 1, 0]", "polynomial = [7, 3, 0]"), "does not stand out in it"),
        (("frequency = 132e9\nlo_frequency = 21e9", "frequency = 138e9\nlo_frequency = 22e9"), "carrier [Hz]"),
        (("order = 7\npolynomial = [7, 1, 0]", "order = 8\npolynomial = [8, 4, 3, 2, 0]"), "samples per capture"),
    ],
)
def test_the_back_to_back_of_another_sounder_is_refused(copied, campaign, replaced, expected, capsys):
    other = copied / "other"
    other.mkdir()
    (other / "sounder.toml").write_text(SOUNDER.replace(*replaced), encoding="utf-8")
    (other / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert run("simulate", other / "scene.toml", "--out", other) == 0
    capsys.readouterr()
    b2b = other / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / "out") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{b2b}: back-to-back of another sounder: ")
    assert expected in line
    assert names(copied / "out") == []


def test_the_positions_of_one_file_share_one_line(campaign, joined, tmp_path, capsys):
    layout = joined.with_name("layout.toml")
    layout.write_text(
        layout.read_text().replace("[positions]", "[sounder.waveform]\npolynomial = [7, 3, 0]\n[positions]")
    )
    described = ("--layout", layout, "--sounder", campaign / "sounder.toml")
    assert run("process", joined, *described, "--out", tmp_path / "out") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("sounder info on it shows the sequence that it holds (all 2 positions of foreign.h5)")


def test_no_back_to_back_at_all_is_reported(copied, capsys):
    recording, absent = copied / "RX1.h5", copied / "absent.h5"
    assert run("process", recording, "--out", copied / "out") == 1
    first = capsys.readouterr().err
    assert first.startswith(
        f"{recording}: no back-to-back capture; pass one with --calibration; the shipped synthetic "
    )
    assert run("process", recording, "--calibration", absent, "--out", copied / "out") == 1
    second = capsys.readouterr().err
    assert second.startswith(f"{absent}: no such file; expected a back-to-back recording; the shipped synthetic ")
    for line in (first, second):  # and there it is
        assert dict(describe_file(Path(line.strip().rpartition(" is ")[2])))["kind"] == "back-to-back recording"


def test_a_back_to_back_of_zeros_is_reported(copied, capsys):
    with h5py.File(copied / "back-to-back.h5", "r+") as file:
        file["iq"][()] = 0
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / "out") == 1
    assert capsys.readouterr().err == f"{b2b}: all back-to-back samples are zero; record it again\n"


@pytest.mark.parametrize(
    ("name", "content"),
    [("layout.toml", "captures = 1"), ("sounder.toml", "[waveform]\norder = 3"), ("layout.toml", None)],
)
def test_a_layout_or_description_that_is_none_stops_at_once(copied, name, content, capsys):
    if content:
        (copied / name).write_text(content, encoding="utf-8")
    option = "--" + name.removesuffix(".toml")
    assert run("process", copied / "RX1.h5", option, copied / name, "--out", copied / "out") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{copied / name}: ")
    assert names(copied / "out") == []
