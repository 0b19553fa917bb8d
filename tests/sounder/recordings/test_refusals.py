"""Native files that do not fit are refused in one line."""

import h5py
import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.recordings import native
from sounder.recordings.open import open_recordings

from .files import IQ, edit


@pytest.mark.parametrize(
    ("datasets", "expected"),
    [
        ({"iq": None}, "the file has no iq; expected a recording as described in docs/formats.md"),
        ({"rx_position": None, "azimuth": None}, "the file has no azimuth, rx_position"),
        (
            {"iq": IQ[:2]},
            "iq is int16 (2, 2, 3, 254, 2); expected int16 (3 azimuths, 2 elevations, snapshot, sample, 2)",
        ),
        ({"iq": IQ[..., 0]}, "iq is int16 (3, 2, 3, 254); expected int16"),
        ({"iq": IQ.astype(np.float32)}, "iq is float32"),
        (
            {"iq": IQ[:, :, :, :250]},
            "250 samples per capture, but 132 GHz rotating-horn sounder describes 254 (order 7, 2 samples per chip); "
            "pass its description with --sounder or export the recording again",
        ),
        (
            {"rx_position": [[1.0, np.nan, 2.0]]},
            "P 1: rx_position is [1.0, nan, 2.0]; expected three finite numbers [m]",
        ),
        ({"rx_position": [[1.0, 2.0]]}, "rx_position has 2 numbers; expected 3"),
        (
            {"rx_position": [[1.0, 2.0, 3.0]], "tx_position": [[1.0, 2.0, 3.0]]},
            "P 1: tx_position equals rx_position [1.0, 2.0, 3.0]; expected two different positions",
        ),
        ({"azimuth": [0.0, 200.0, 90.0]}, "azimuth is not in ascending order"),
        ({"elevation": [0.0, np.nan]}, "elevation is not in ascending order; expected finite ascending values"),
        ({"valid": np.ones((2, 3))}, "valid has shape (2, 3); expected (azimuth, elevation), (3, 2)"),
        ({"agc_gain": np.full((3, 2), np.inf)}, "agc_gain is inf dB; expected at most 200 dB in each direction"),
        ({"iq": IQ[:, :, :0]}, "no snapshot"),
    ],
)
def test_what_does_not_fit_is_reported_in_one_line(path, datasets, expected):
    edit(path, **datasets)
    with pytest.raises(DataError) as error:
        open_recordings(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert expected in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("attribute", "value", "expected"),
    [
        ("sounder", "{", "expected a sounder description"),
        ("sounder", '{"name": "x"}', "attribute sounder: waveform: missing; "),
        ("kind", "something", "not a recording of a known format; describe its layout with --layout FILE"),
    ],
)
def test_attributes_that_do_not_fit_are_reported(path, attribute, value, expected):
    with h5py.File(path, "r+") as file:
        file.attrs[attribute] = value
    with pytest.raises(DataError) as error:
        open_recordings(path)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, None])
def test_a_recording_without_a_scale_is_refused(path, scale):
    with h5py.File(path, "r+") as file:
        del file["iq"].attrs["scale_factor"]
        if scale is not None:
            file["iq"].attrs["scale_factor"] = scale
    with pytest.raises(DataError, match="expected the amplitude of one LSB, a positive number"):
        open_recordings(path)


def test_files_of_other_formats_are_reported(tmp_path, path):
    with pytest.raises(DataError, match="no such file"):
        open_recordings(tmp_path / "none.h5")
    text = tmp_path / "text.h5"
    text.write_text("not HDF5")
    with pytest.raises(DataError, match="not an HDF5 file"):
        open_recordings(text)
    with pytest.raises(DataError, match="not an HDF5 file"):
        native.back_to_back(text)
    with pytest.raises(DataError, match=r"not a back-to-back recording"):
        native.back_to_back(path)
    cut = tmp_path / "cut.h5"
    cut.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(DataError, match=r"cut\.h5: "):
        open_recordings(cut)


def test_samples_that_cannot_be_read_cost_this_file_alone(path):
    with h5py.File(path, "r+") as file:
        samples, scale = file["iq"][()], file["iq"].attrs["scale_factor"]
        del file["iq"]
        file.create_dataset("iq", data=samples, chunks=samples.shape, compression="gzip", fletcher32=True)
        file["iq"].attrs["scale_factor"] = scale
        start = file["iq"].id.get_chunk_info(0).byte_offset
    with path.open("r+b") as raw:
        raw.seek(start + 100)
        raw.write(bytes(64))
    (back,) = open_recordings(path)
    with pytest.raises(DataError, match=r"damaged HDF5 file \(iq: "):
        back.captures(0, 0)
