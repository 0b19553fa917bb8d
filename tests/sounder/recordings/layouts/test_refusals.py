"""Files that do not have their layout, and invalid layouts, are reported in one line."""

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.recordings import foreign
from sounder.recordings.layout import load_layout

from .captures import IQ, PLAIN, POSITIONS, change


@pytest.mark.parametrize(
    ("layout", "expected"),
    [
        (change('"raw"', '"samples"'), "no dataset samples, which the layout names"),
        (change('"raw"', '"group"'), "no dataset group, which the layout names"),
        (change("2e-7", '{ attribute = "lsb" }'), "no attribute lsb, which the layout names"),
        (change("2e-7", '{ dataset = "text" }'), "scale_factor: text is |S3; expected real numbers"),
        (change("2e-7", '{ dataset = "wrong" }'), "scale_factor is an array (5,); expected one finite number"),
        (change("2e-7", "0.0"), "scale_factor is 0; expected a positive number"),
        (change(', "iq"', ""), "raw has 6 axes (2, 4, 3, 3, 254, 2), but the layout names 5: position"),
        (change('"sample", "iq"', '"iq", "sample"'), "axis iq of raw has length 254; expected 2 (I, Q)"),
        (
            change("[10, 100, 190, 280]", "[10, 100, 190]"),
            "4 captures along azimuth, but the grid has 3 values; raw is (2, 4, 3, 3, 254, 2), read as position, "
            "azimuth, elevation, snapshot, sample, iq; list captures.axes in the order",
        ),
        (
            change('"snapshot", "sample"', '"sample", "snapshot"'),
            "3 samples per capture, but the sequence has 254; raw is",
        ),
        (change("[10, 100, 190, 280]", "[10, 100, 190, 370]"), "the grid lists a direction twice"),
        (change("[10, 100, 190, 280]", '{ dataset = "nan" }'), "grid.azimuth is [0.0, nan, 0.0, 0.0]; expected"),
        (change("[-9, 0, 9]", "[81, 90, 99]"), "grid.elevation is outside -90 to 90 degrees above the horizon"),
        (change(", [32, -50, 1.5]", ""), None),
        (
            change("[32, -50, 1.5]", "[32, -50, 1.5], [1, 2, 3]"),
            "positions.rx has shape (3, 3); expected (3,) or (2, 3)",
        ),
        (
            change("[positions]", "[positions]\nlos = 5"),
            "positions.los is 5; expected 1 (line of sight), 0 (none) or -1",
        ),
        (
            change("[positions]", '[positions]\nlos = { dataset = "wrong" }'),
            "positions.los has shape (5,); expected one number or 2",
        ),
        (
            'agc_gain = { dataset = "wrong" }' + PLAIN,
            "agc_gain has shape (5,); expected one number, one for each position, or (2, 4, 3) along the axes of",
        ),
        (
            'time = { dataset = "agc_nan" }' + PLAIN,
            "time holds NaN or infinite values",
        ),
        (
            PLAIN + "[sounder.waveform]\norder = 8\n",
            "the layout's [sounder]: waveform: polynomial is [7, 1, 0]; expected exponents in descending order from 8",
        ),
        (PLAIN + "[sounder.waveform]\nchirp = 8\n", "the layout's [sounder]: waveform.chirp: unknown key"),
        (
            PLAIN + "[sounder.waveform]\nsamples_per_chip = {}\n",
            "the layout's [sounder]: waveform.samples_per_chip is {}; expected a whole number",
        ),
        (
            PLAIN + '[sounder]\nname = { dataset = "raw" }\n',
            "name: raw is int16 (2, 4, 3, 3, 254, 2); expected",
        ),
        (PLAIN + '[sounder.carrier]\nfrequency = { of = "raw" }\n', "frequency: expected either a dataset or"),
        (PLAIN + '[back_to_back]\ndataset = "b"\naxes = ["sample"]\nattenuation = 60\n', "no dataset b,"),
        (
            PLAIN + '[back_to_back]\ndataset = "wrong"\naxes = ["sample"]\nattenuation = 60\n',
            "wrong is float64; real numbers need the axis iq or the key imaginary, complex",
        ),
    ],
)
def test_a_file_that_is_not_as_the_layout_says_is_reported_in_one_line(opened, layout, expected):
    content = {"raw": IQ, "group/x": 1, "text": "abc", "wrong": np.zeros(5), "nan": [0, np.nan, 0, 0]}
    content["agc_nan"] = np.full((2, 4, 3), np.nan)
    if expected is None:  # one point serves all positions
        assert len(opened(content, layout)[0]) == POSITIONS
        return
    with pytest.raises(DataError) as error:
        opened(content, layout)
    assert expected in str(error.value)
    assert "foreign.h5: " in str(error.value)
    assert "\n" not in str(error.value)


def test_samples_that_do_not_fit_the_description_are_reported(opened):
    found, _ = opened({"raw": IQ[..., :250, :]}, PLAIN)
    assert all("250 samples per capture, but 132 GHz rotating-horn sounder describes 254" in str(r) for r in found)


@pytest.mark.parametrize(
    ("layout", "expected"),
    [
        (change("[grid]", "[grid]\ncolour = 1"), "grid.colour: unknown key"),
        (change('"iq"]', '"iq", "iq"]'), "captures: axes lists an axis twice"),
        (change('"sample"', '"samples"'), "captures.axes.4 is 'samples'; expected 'position', 'tx', 'rx'"),
        (change('"sample", ', ""), "captures: axes has no sample"),
        (change('"position"', '"direction"'), "captures: axes has direction and azimuth or elevation"),
        (
            change('"raw"', '"raw"\nimaginary = "q"'),
            "captures: axes has iq, but imaginary says that I and Q are two datasets",
        ),
        (change("2e-7", "{}"), "scale_factor: found {}; expected a number, { dataset"),
        (change("2e-7", "nan"), "scale_factor: found nan; expected a number"),
        (
            change("tx = [0, 0, 28.4]", "tx = [0, 0]"),
            "positions.tx: found [0, 0]; expected three numbers, a list of these",
        ),
        (change("tx = [0, 0, 28.4]\n", ""), "positions: tx: missing"),
        (change("[positions]", '[positions]\nname = "RX{place}"'), "positions: name is"),
        (
            PLAIN + '[back_to_back]\ndataset = "b"\naxes = ["azimuth", "sample"]\nattenuation = 60\n',
            "back_to_back: axes has azimuth",
        ),
        ("captures = ", "not TOML"),
    ],
)
def test_an_invalid_layout_is_reported_in_one_line(tmp_path, layout, expected):
    path = tmp_path / "layout.toml"
    path.write_text(layout, encoding="utf-8")
    with pytest.raises(DataError) as error:
        load_layout(path)
    assert str(error.value).startswith(f"{path}: ")
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content"), [("x.mat", b"not MATLAB at all"), ("x.dat", b"something"), ("y.mat", None)]
)
def test_files_of_other_formats_are_reported(tmp_path, sounder, name, content):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    (tmp_path / "layout.toml").write_text(PLAIN, encoding="utf-8")
    with pytest.raises(DataError, match=r"not a MATLAB file|not an HDF5 file|no such file"):
        foreign.recordings(path, load_layout(tmp_path / "layout.toml"), sounder)
