"""A bad recording is reported in one line, and the other recordings are processed."""

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.constants import c

from .commands import facts, group, names, run


def spoil(path: Path, what: str) -> None:
    with h5py.File(path, "r+") as file:
        iq = file["iq"]
        if what == "samples":
            data, scale = iq[..., :200, :], iq.attrs["scale_factor"]
            del file["iq"], file.attrs["members"]  # as if it had been written so
            file["iq"] = data
            file["iq"].attrs["scale_factor"] = scale
        elif what == "nan":
            file["rx_position"][0, 1] = np.nan
        elif what == "same":
            file["rx_position"][()] = file["tx_position"][()]
        elif what == "zero":
            iq[()] = 0
        elif what == "damaged":
            del file["iq"]


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        (
            "samples",
            "200 samples per capture, but small sounder describes 254 (order 7, 2 samples per chip); pass",
        ),
        ("nan", "RX1: rx_position is [12.0, nan, 1.5]; expected three finite numbers [m]"),
        ("same", "RX1: tx_position equals rx_position [4.0, 5.0, 3.0]; expected two different positions"),
        ("zero", "RX1: all samples are zero, in all directions; record the position again"),
        ("damaged", "the file has no iq"),
    ],
)
@pytest.mark.slow
def test_a_bad_recording_is_named_and_the_rest_processed(copied, what, expected, capsys):
    spoil(copied / "RX1.h5", what)
    out = copied / "out"
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", copied / "RX2.h5", "--calibration", b2b, "--out", out) == 1
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert line.startswith(str(copied / "RX1.h5"))
    assert expected in line
    assert names(out) == ["RX2.h5"]
    assert printed.out == f"{out}: 1 product\n"


@pytest.mark.slow
def test_what_is_no_recording_is_named(copied, capsys):
    text = copied / "text.h5"
    text.write_text("not HDF5")
    absent, b2b, out = copied / "absent.h5", copied / "back-to-back.h5", copied / "out"
    assert run("process", absent, text, b2b, copied / "RX2.h5", "--calibration", b2b, "--out", out) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"{absent}: no such file"
    assert lines[1].startswith(
        f"{text}: not an HDF5 file; expected a recording in HDF5, or a MATLAB file (.mat) with --lay"
    )
    assert [line.split(": ")[0] for line in lines] == [str(absent), str(text), str(b2b)]
    assert names(out) == ["RX2.h5"]


def test_what_is_not_hdf5_is_reported_without_advice_that_was_followed(copied, joined, capsys):
    text, layout = copied / "text.h5", joined.with_name("layout.toml")
    text.write_text("not HDF5")
    expected = f"{text}: not an HDF5 file; expected an HDF5 file, or one of another known format\n"
    for command in (("process", text, "--out", copied / "out"), ("info", text)):
        assert run(*command, "--layout", layout) == 1
        assert capsys.readouterr().err == expected
    assert run("process", copied / "RX1.h5", "--calibration", text, "--out", copied / "out") == 1
    assert capsys.readouterr().err == f"{text}: not an HDF5 file; expected a back-to-back recording\n"


@pytest.mark.slow
def test_directions_of_zeros_or_clipped_samples_are_summed_up(copied, capsys):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file["iq"][2, 0] = 0
        file["iq"][7, 1, 0, :2] = [[-32768, 32767], [32767, 0]]
        for a in range(8, 11):
            file["iq"][a, 1, 1, 7] = -32768, 32767
    b2b, out = copied / "back-to-back.h5", copied / "out"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", out) == 1
    burst, zero, clipped = capsys.readouterr().err.splitlines()
    assert "a snapshot holds a burst of noise" in burst  # the samples at the rails
    who = f"{copied / 'RX1.h5'}: RX1: "
    assert zero == f"{who}all samples are zero in 1 of 24 directions: (azimuth, elevation) (60, -15); left out"
    # 3 of 2 x 254 x 2 numbers at worst
    assert clipped == (
        f"{who}samples are clipped (up to 0.3 %) in 4 of 24 directions: (azimuth, elevation) (210, 15), (240, 15), "
        "(270, 15) and 1 more; left out; lower the receiver gain"
    )
    daps = group(out / "RX1.h5", "/daps")
    assert daps["daps"].sel(azimuth=60, elevation=-15).isnull().all()
    assert daps["daps"].isnull().sum() == 5 * 254
    assert group(out / "RX1.h5", "/").attrs["problem_directions"] == 5
    capsys.readouterr()
    assert run("info", copied / "RX1.h5") == 0
    assert facts(capsys)["health"] == "no direction missing, 1 all zero, 4 clipped"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("end", "east"),
    [("rx_position", 62.0), ("tx_position", -46.0)],  # the period is 63.5 m of path
)
def test_a_gain_over_free_space_tells_that_a_position_is_wrong(copied, end, east, capsys):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file[end][0, 0] = east
    b2b, out = copied / "back-to-back.h5", copied / "out"
    assert run("process", copied / "RX1.h5", copied / "RX2.h5", "--calibration", b2b, "--out", out) == 1
    # that the direct path is not where the positions say is told as well
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "free space over" in line]
    # the direct path of 8.4 m is taken for one that is a period later
    length = np.sqrt(8**2 + 2**2 + 1.5**2)
    gain, later = (20 * np.log10(c / 132e9 / (4 * np.pi * metres)) for metres in (length, length + 254 / 1.2e9 * c))
    expected = re.fullmatch(
        re.escape(f"{copied / 'RX1.h5'}: RX1: the MPC at ")
        + r"([\d.]+) ns has a path gain of (-[\d.]+) dB; free space "
        r"over ([\d.]+) m allows (-[\d.]+) dB: check the positions .*; do not trust the product",
        line,
    )
    assert expected is not None, line
    # delays to 0.1 ns and a gain to 1 dB, as in a sound recording; the free-space gain is rounded to 0.1 dB
    assert float(expected[1]) == pytest.approx((length / c + 254 / 1.2e9) * 1e9, abs=0.1)
    assert float(expected[2]) == pytest.approx(gain, abs=1.0)
    assert float(expected[4]) == pytest.approx(later, abs=0.1)
    assert names(out) == ["RX1.h5", "RX2.h5"]


@pytest.mark.slow
def test_missing_directions_are_processed_and_noted(copied, capsys):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file["valid"][4:6] = 0
    out = copied / "out"
    assert run("process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5", "--out", out) == 0
    (note,) = capsys.readouterr().err.splitlines()
    assert note == (
        f"note: {copied / 'RX1.h5'}: RX1: 4 of 24 directions missing: (azimuth, elevation) (120, -15), (150, -15), "
        "(120, 15) and 1 more; processed without them"
    )
    assert group(out / "RX1.h5", "/").attrs["missing_directions"] == 4
    assert group(out / "RX1.h5", "/mpc").sizes["mpc"] > 0
    assert run("info", copied / "RX1.h5") == 0
    assert facts(capsys)["health"].startswith("4 directions missing")
