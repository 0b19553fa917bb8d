"""Native files give back what was put in, read nothing before it is asked for, and refuse what does not fit."""

import hashlib
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from erm.errors import DataError
from sounder import twin
from sounder.readers import native, open_recordings
from sounder.recording import Recording
from sounder.writer import write_back_to_back, write_recording

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}
SCAN = {"azimuth": [0.0, 90.0, 200.0], "elevation": [-9.0, 9.0]}


@pytest.fixture(scope="module")
def sounder(description):
    return description(waveform=WAVEFORM, scan=SCAN)


@pytest.fixture(scope="module")
def recording(sounder) -> Recording:
    """Noise of the instrument, with its gain control and its clock."""
    none = {name: ("path", np.zeros(0)) for name in ("delay", "azimuth", "elevation", "coefficient")}
    return twin.record(
        xr.Dataset(none),
        sounder,
        name="P 1",
        tx_position=(0.1, -2.3, 28.4),
        rx_position=(31.06, -46.64, 1.4),
        snapshots=3,
        los=0,
        start=1.7e9,
    )


@pytest.fixture
def path(tmp_path: Path, recording: Recording) -> Path:
    write_recording(recording, tmp_path / "p1.h5", history="test")
    return tmp_path / "p1.h5"


def test_a_recording_comes_back_bit_for_bit(path, recording):
    (back,) = open_recordings(path)
    for a, e in np.ndindex(3, 2):
        captures = back.captures(a, e)
        assert captures.dtype == np.int16
        assert captures.shape == (3, 254, 2)
        assert np.array_equal(captures, recording.captures(a, e))
        assert np.array_equal(back.captures(a, e, slice(1, 2)), recording.captures(a, e)[1:2])
    for name in ("azimuth", "elevation", "tx_position", "rx_position", "agc_gain", "valid", "time"):
        assert np.array_equal(getattr(back, name), getattr(recording, name)), name
    for name in ("name", "los", "scale_factor", "snapshots", "sounder"):
        assert getattr(back, name) == getattr(recording, name), name
    assert back.source == path
    assert back.missing == []


def test_the_same_recording_gives_the_same_bytes(path, recording):
    again = path.with_name("again.h5")
    write_recording(recording, again, history="test")
    assert again.read_bytes() == path.read_bytes()


def test_reading_leaves_the_file_as_it_was_and_the_samples_cannot_be_written(path):
    before = hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mtime_ns
    (back,) = open_recordings(path)
    captures = back.captures(0, 0)
    with pytest.raises(ValueError, match="read-only"):
        captures[0] = 0
    assert (hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mtime_ns) == before


@pytest.mark.parametrize("storage", [{}, {"chunks": (1, 1, 1, 254, 2)}])
def test_opening_reads_no_sample(path, storage, monkeypatch):
    # 4 GB of samples that are not there, as a sparse file: reading them would be noticed
    snapshots = 6 * 10**5
    with h5py.File(path, "r+") as file:
        scale = file["iq"].attrs["scale_factor"]
        del file["iq"]
        iq = file.create_dataset("iq", (3, 2, snapshots, 254, 2), np.int16, **storage)
        iq.attrs["scale_factor"] = scale
        iq[2, 1, snapshots - 1] = 7  # gives the dataset its place in the file
    asked = []
    getitem = h5py.Dataset.__getitem__
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda self, at: (asked.append(self.name), getitem(self, at))[1])
    (back,) = open_recordings(path)
    assert back.snapshots == snapshots
    assert "/iq" not in asked
    assert (back.captures(2, 1, slice(-1, None)) == 7).all()
    # contiguous samples are mapped, others read where they are
    assert ("/iq" in asked) == bool(storage)
    assert isinstance(back.captures(2, 1, slice(-2, None)), np.memmap) != bool(storage)


def test_mapped_and_read_samples_are_the_same(path, recording):
    with h5py.File(path, "r+") as file:
        samples, scale = file["iq"][()], file["iq"].attrs["scale_factor"]
        del file["iq"]
        file.create_dataset("iq", data=samples, chunks=(1, 1, 3, 254, 2), compression="gzip")
        file["iq"].attrs["scale_factor"] = scale
    (back,) = open_recordings(path)
    assert np.array_equal(back.captures(1, 0), recording.captures(1, 0))


def test_what_may_be_absent_is_assumed(path):
    with h5py.File(path, "r+") as file:
        for name in ("agc_gain", "valid", "time"):
            del file[name]
        del file.attrs["los"], file.attrs["position"]
    (back,) = open_recordings(path)
    assert (back.name, back.los, back.time) == ("p1", -1, None)
    assert np.array_equal(back.agc_gain, np.zeros((3, 2)))
    assert back.valid.all()


def test_directions_not_recorded_are_missing(path):
    with h5py.File(path, "r+") as file:
        file["valid"][1, 0] = 0
        file["agc_gain"][1, 0] = np.nan  # nobody knows
    (back,) = open_recordings(path)
    assert back.missing == [(90.0, -9.0)]


def test_a_scan_that_is_wider_than_the_recording_leaves_directions_missing(path, description):
    # the same directions, counted from -180
    wider = description(waveform=WAVEFORM, scan={"azimuth": [-160.0, 0.0, 45.0, 90.0], "elevation": [-9.0, 9.0]})
    (back,) = open_recordings(path, wider)
    assert back.missing == [(45.0, -9.0), (45.0, 9.0)]


def test_provenance_stands_in_the_file(path, recording):
    with h5py.File(path) as file:
        attributes = dict(file.attrs)
        assert file["iq"].attrs["units"] == "mW0.5"
        assert [dim.label for dim in file["iq"].dims] == ["azimuth", "elevation", "snapshot", "sample", "iq"]
    assert {"Conventions", "title", "source", "history", "software_version", "input_sha256"} <= attributes.keys()
    assert json.loads(attributes["sounder"])["name"] == recording.sounder.name


def edit(path: Path, **datasets) -> None:
    with h5py.File(path, "r+") as file:
        for name, data in datasets.items():
            attributes = dict(file[name].attrs) if name in file else {}
            if name in file:
                del file[name]
            if data is not None:
                file[name] = data
                file[name].attrs.update(attributes)


IQ = np.zeros((3, 2, 3, 254, 2), np.int16)


@pytest.mark.parametrize(
    ("datasets", "told"),
    [
        ({"iq": None}, "no iq in the file; expected a recording as docs/formats.md describes"),
        ({"rx_position": None, "azimuth": None}, "no azimuth, rx_position in the file"),
        (
            {"iq": IQ[:2]},
            "iq is int16 (2, 2, 3, 254, 2); expected int16 (3 azimuths, 2 elevations, snapshot, sample, 2)",
        ),
        ({"iq": IQ[..., 0]}, "iq is int16 (3, 2, 3, 254); expected int16"),
        ({"iq": IQ.astype(np.float32)}, "iq is float32"),
        (
            {"iq": IQ[:, :, :, :250]},
            "250 samples a capture, but 132 GHz rotating-horn sounder describes 254 (order 7, 2 samples a chip); pass "
            "--sounder or re-export the recording",
        ),
        ({"rx_position": [[1.0, np.nan, 2.0]]}, "P 1: rx_position is [1.0, nan, 2.0]; expected three finite metres"),
        ({"rx_position": [[1.0, 2.0]]}, "rx_position has 2 numbers; expected 3"),
        (
            {"rx_position": [[1.0, 2.0, 3.0]], "tx_position": [[1.0, 2.0, 3.0]]},
            "P 1: tx_position equals rx_position [1.0, 2.0, 3.0]; expected two places",
        ),
        ({"azimuth": [0.0, 200.0, 90.0]}, "azimuth does not rise"),
        ({"elevation": [0.0, np.nan]}, "elevation does not rise; expected finite values in rising order"),
        ({"valid": np.ones((2, 3))}, "valid has shape (2, 3); expected (azimuth, elevation), (3, 2)"),
        ({"agc_gain": np.full((3, 2), np.inf)}, "agc_gain is not finite in every recorded direction"),
        ({"iq": IQ[:, :, :0]}, "no snapshot"),
    ],
)
def test_what_does_not_fit_is_told_in_one_line(path, datasets, told):
    edit(path, **datasets)
    with pytest.raises(DataError) as error:
        open_recordings(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert told in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("attribute", "value", "told"),
    [
        ("sounder", "{", "no readable sounder description"),
        ("sounder", '{"name": "x"}', "attribute sounder: waveform: missing; "),
        ("kind", "something", "not a recording of a known format; say how it is laid out with --layout FILE"),
    ],
)
def test_attributes_that_do_not_fit_are_told(path, attribute, value, told):
    with h5py.File(path, "r+") as file:
        file.attrs[attribute] = value
    with pytest.raises(DataError) as error:
        open_recordings(path)
    assert told in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, None])
def test_a_recording_without_a_scale_is_refused(path, scale):
    with h5py.File(path, "r+") as file:
        del file["iq"].attrs["scale_factor"]
        if scale is not None:
            file["iq"].attrs["scale_factor"] = scale
    with pytest.raises(DataError, match="expected the positive amplitude of one LSB"):
        open_recordings(path)


def test_files_that_are_none_are_told(tmp_path, path):
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
    with pytest.raises(DataError, match="iq cannot be read"):
        back.captures(0, 0)


@pytest.mark.parametrize("attenuator", [60.0, (np.linspace(131e9, 133e9, 5), np.linspace(1, 2, 5) * 1e-3j)])
def test_a_back_to_back_comes_back(tmp_path, sounder, attenuator):
    made = twin.back_to_back(sounder, attenuator, snapshots=2)
    write_back_to_back(made, tmp_path / "b2b.h5", history="test")
    back = native.back_to_back(tmp_path / "b2b.h5")
    assert np.array_equal(back.captures, made.captures)
    assert back.captures.dtype == np.int16
    for name in ("sounder", "scale_factor", "attenuation", "includes_tx_antenna"):
        assert getattr(back, name) == getattr(made, name), name
    assert (back.s21 is None) == (made.s21 is None)
    if back.s21 is not None and made.s21 is not None:
        assert np.array_equal(back.s21, made.s21)


@pytest.mark.parametrize(
    ("datasets", "told"),
    [
        ({"iq": None}, "no iq in the file"),
        ({"iq": IQ[0, 0, 0]}, "expected int16 (snapshot, sample, 2)"),
        ({"attenuator_frequency": None}, "no attenuator_frequency in the file"),
        ({"attenuator_frequency": [1.0, 3.0, 2.0, 4.0, 5.0]}, "attenuator_frequency does not rise"),
        ({"attenuator_s21": np.ones(5)}, "attenuator_s21 has shape (5,); expected (5, 2)"),
    ],
)
def test_a_back_to_back_that_does_not_fit_is_told(tmp_path, sounder, datasets, told):
    path = tmp_path / "b2b.h5"
    measured = np.linspace(131e9, 133e9, 5), np.ones(5) * 1e-3j
    write_back_to_back(twin.back_to_back(sounder, measured, snapshots=2), path, history="test")
    edit(path, **datasets)
    with pytest.raises(DataError) as error:
        native.back_to_back(path)
    assert told in str(error.value)


def test_a_back_to_back_without_its_loss_is_refused(tmp_path, sounder):
    path = tmp_path / "b2b.h5"
    write_back_to_back(twin.back_to_back(sounder, 60.0, snapshots=2), path, history="test")
    with h5py.File(path, "r+") as file:
        del file.attrs["attenuation"]
    with pytest.raises(DataError, match="expected the loss of the attenuator in dB"):
        native.back_to_back(path)


@pytest.mark.parametrize(
    "wanted", [slice(None, None, 2), slice(1, None), slice(None, None, -1), slice(3, 3), slice(-1, None)]
)
def test_any_slice_of_snapshots_is_what_numpy_would_take(path, wanted):
    (back,) = open_recordings(path)
    assert np.array_equal(back.captures(1, 1, wanted), np.asarray(back.captures(1, 1))[wanted])
